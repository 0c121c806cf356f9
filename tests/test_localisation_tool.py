"""What the tables of docs/localisation.md rest on."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import reference_detection as reference
from scenes import corner_cameras

from stseg.detection.pillar_strips import Pillars

sys.path.append(str(Path(__file__).parents[1] / "tools"))

import localisation_experiment as experiment
import localisation_picture
import pillar_error
from result_sets import SETS
from results import Bench


def test_so_much_of_a_map_is_torn_in_squares() -> None:
    lots = np.random.default_rng(1)
    one, blind, other = experiment.torn(
        [np.ones((240, 330), np.float32), None, np.ones((60, 80), np.float32)], 0.3, lots
    )
    assert blind is None and isinstance(one, np.ndarray) and isinstance(other, np.ndarray)
    assert one.shape == (240, 330) and other.shape == (60, 80)
    assert abs(one.mean() - 0.7) < 0.1
    squares = one[:240, :320].reshape(12, 20, 16, 20)
    np.testing.assert_array_equal(squares, np.broadcast_to(squares[:, :1, :, :1], squares.shape))


def test_maxima_are_what_no_neighbour_exceeds() -> None:
    ground = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), -1)
    weight = np.zeros((4, 5))
    weight[1, 1], weight[1, 2], weight[3, 4] = 2.0, 1.0, 0.5
    np.testing.assert_array_equal(experiment._maxima(weight, ground), [[1.0, 1.0], [4.0, 3.0]])


def test_people_are_found_missed_and_candidates_extra(tmp_path: Path) -> None:
    (tmp_path / "truth.csv").write_text("frame,id,x,y\n0,1,0,0\n0,2,3,0\n4,1,1,1\n4,2,5,5\n", encoding="utf-8")
    one = replace(SETS["easy"], truth="$WORK/truth.csv")
    rows = [experiment._rows(0, np.array([[0.3, 0.0], [0.4, 0.0]])), experiment._rows(4, np.array([[1.0, 1.1]]))]
    found = experiment.judged(one, Bench(tmp_path, tmp_path), np.concatenate(rows), [0, 4])
    assert (found.people, found.found) == (4, 3)
    assert found.distance == {(0, 0): pytest.approx(0.3), (1, 0): pytest.approx(0.1)}
    assert experiment._cells(found, {(0, 0)}) == "0.200 | 0.200 | 0.300 | 2 | 2 | 1"
    assert experiment._cells(experiment.Judged({}, 4, 0), set()) == " |  |  | 0 | 4 | 0"


def test_a_picture_shows_both_maps(tmp_path: Path) -> None:
    ground = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), -1)
    ways = (f"{name}, C {kernel}" for name in ("probability, modes", "volume, modes") for kernel in (0.8, 0.3))
    shown = localisation_picture.Shown(ground, np.eye(4, 5), ground, np.eye(4, 5), dict.fromkeys(ways, ground[1]))
    localisation_picture.picture(tmp_path / "shown.png", shown, ground[2])
    assert (tmp_path / "shown.png").stat().st_size > 1000


def test_strips_are_cut_as_they_are_summed() -> None:
    camera = corner_cameras()[0]
    pillars = Pillars.of(camera, np.array([[0.3, -0.2]]), pillar_error.HEIGHTS, pillar_error.WIDTH)
    shape = (camera.size[1], camera.size[0])
    for tall in (0, 9):
        image = pillar_error.cut(pillars, 0, tall, 0.3, (shape[0] + 80, shape[1] + 80), 40)
        np.testing.assert_array_equal(image, reference.region(pillars, 0, tall, 0.3, 40, shape))


def test_a_pillar_drawn_is_as_tall_as_it_is_in_the_image() -> None:
    camera = corner_cameras()[2]
    image = pillar_error.drawn(camera, np.array([0.0, 0.0]), 1.7, 0.3, 20)
    rows = np.flatnonzero((image > 0.5).any(1))
    (foot, head), _ = camera.project(np.zeros((2, 2)), np.array([0.0, 1.7]))
    assert rows.min() - 20 == pytest.approx(head[1], abs=3) and rows.max() - 20 == pytest.approx(foot[1], abs=3)
    assert 0 < pillar_error.overlap(image, pillar_error.boxed(image)) <= 1
