"""Calibrated probability of cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from run_files import small_volume, write_small_run
from scipy.special import expit

from stseg.geometry import Grid
from stseg.io.runfile.runs import read_run
from stseg.records.cell_reliability import (
    LOG_ODDS_KNOTS,
    CellCounts,
    CellReliability,
    count_cells,
    doubtful_cells,
    filled_cells,
)

GRID = Grid((-1.0, 1.0), (-1.0, 1.0), 0.1, 1.8, 10)


def people(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(list(rows), [("x", float), ("y", float), ("height", float)])


def test_evidence_that_counts_twice_is_calibrated() -> None:
    """Log-odds twice too loud, learned on one half of the cells and judged on the other."""
    rng = np.random.default_rng(0)
    log_odds = rng.normal(0.0, 2.0, (2, 10, 60, 60))
    filled = rng.random(log_odds.shape) < expit(log_odds)
    loud, everywhere = (2 * log_odds).astype(np.float32), np.ones(log_odds.shape[1:], bool)
    reliability = CellReliability.of([count_cells(loud[0], filled[0], everywhere)])
    stated = reliability.of_cells(loud[1])
    for low in np.arange(0.0, 1.0, 0.1):
        of_bin = (stated >= low) & (stated < low + 0.1)
        assert filled[1][of_bin].mean() == pytest.approx(stated[of_bin].mean(), abs=0.03)
    assert (np.diff(reliability.probability) >= 0).all()


def test_nothing_counted_is_a_half() -> None:
    np.testing.assert_array_equal(CellReliability.of([]).probability, 0.5)
    empty = CellCounts(np.zeros(len(LOG_ODDS_KNOTS)), np.zeros(len(LOG_ODDS_KNOTS)))
    np.testing.assert_array_equal(CellReliability.of([empty]).probability, 0.5)


def test_cells_that_anybody_fills() -> None:
    both = people((0.3, 0.3, 1.5), (-0.4, 0.0, 1.9))
    apart = [filled_cells(GRID, both[k : k + 1]) for k in range(2)]
    np.testing.assert_array_equal(filled_cells(GRID, both), apart[0] | apart[1])
    assert [cells.any((1, 2)).sum() for cells in apart] == [8, 10]


def test_cells_in_doubt() -> None:
    """Seen cells: all within a metre of somebody, and elsewhere those of little evidence."""
    log_odds = np.full(GRID.shape, -9.0, np.float32)
    log_odds[0, 0, :2] = 1.0, np.nan
    found = doubtful_cells(GRID, log_odds, people((0.9, 0.9, 1.7)))
    assert found[0, 0, 0]
    assert not found[0, 0, 1]
    assert not found[0, 0, 2]
    assert found[:, -1, -1].all()
    log_odds[:, -1, -1] = np.nan
    assert not doubtful_cells(GRID, log_odds, people((0.9, 0.9, 1.7)))[:, -1, -1].any()


def test_of_a_run_file(tmp_path: Path) -> None:
    run = read_run(write_small_run(tmp_path / "night.h5"))
    probability, log_odds = run.read_cell_probability(12), small_volume()[0][2]
    np.testing.assert_array_equal(np.isnan(probability), np.isnan(log_odds))
    seen = ~np.isnan(log_odds)
    order = np.argsort(log_odds[seen])
    assert (np.diff(probability[seen][order]) >= 0).all()
    assert 0 < probability[seen].mean() < 1
