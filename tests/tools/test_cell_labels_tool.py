"""The experiment that scores the labels of cells."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from stseg.geometry import Grid

sys.path.append(str(Path(__file__).parents[2] / "tools"))

from experiments import labels

GRID = Grid((0.0, 3.0), (0.0, 1.0), cell=0.1, top=1.8, planes=3)


def test_cells_are_counted_by_pairs() -> None:
    """Person 1 is track 7 in three of four cells, person 2 is track 9; of the touching cells two of three are right."""
    truth = np.array([[[1, 1, 1, 1, 2, 2, 0, 0]]])
    label = np.array([[[7, 7, 7, 9, 9, 0, 9, 0]]])
    counts = labels.CellCounts()
    counts.add(truth, label, np.array([[[0, 0, 1, 1, 1, 1, 0, 0]]], bool))
    iou, owner = counts.scores()
    assert iou == pytest.approx((3 + 1) / (4 + 4))
    assert owner == pytest.approx(2 / 3)


def test_the_truth_of_cells() -> None:
    rows = np.array(
        [(5, 0.5, 0.5, 1.7), (6, 1.0, 0.5, 1.2), (7, 2.6, 0.5, 1.7)],
        [("id", "i8"), ("x", "f8"), ("y", "f8"), ("height", "f8")],
    )
    truth, touching = labels.truth_of(GRID, rows)
    assert [int(truth[1, 4, k]) for k in (4, 9, 25, 18)] == [5, 6, 7, 0]
    assert set(np.unique(truth[touching])) == {5, 6}


def test_methods_agree_on_separate_people() -> None:
    truth = np.zeros(GRID.shape, np.int32)
    truth[:, 3:7, 3:7], truth[:, 3:7, 23:27] = 1, 2
    u = np.where(truth > 0, 2.0, -2.0).astype(np.float32)
    tracks, ground = np.array([1, 2]), np.array([[0.5, 0.5], [2.5, 0.5]])
    for method in labels.METHODS.values():
        np.testing.assert_array_equal(method(truth, u, tracks, ground, GRID), truth)
