"""Forgetting sums, reliability of cells, sizes, and distance from the border."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_files import small_volume, table_of, write_small_run
from scenes import room
from scipy.special import expit

from stseg import Grid, read_run
from stseg.config import BodyConfig
from stseg.geometry.rig import BODY_HEIGHT
from stseg.records import cell_reliability
from stseg.records.border import Border
from stseg.records.forgetting import Forgetting
from stseg.records.sizes import Sizes
from stseg.records.tables import TRAJECTORY, Tracks, reason_of
from stseg.records.track_heights import with_heights


def test_memory_is_in_seconds_of_rows_and_skipped_frames() -> None:
    for rate, memory, least, frames in ((10.0, 2.0, 0.0, 20), (10.0, 0.1, 3.0, 3)):
        forgetting = Forgetting((2,), rate, memory, least)
        forgetting.add(np.array([1.0, 2.0]))
        for _ in range(frames):
            forgetting.forget()
        np.testing.assert_allclose(forgetting.sums, np.exp(-1) * np.array([1.0, 2.0]))
    skipped, whole = (Forgetting((1,), 10.0, 1.0) for _ in range(2))
    for forgetting in (skipped, whole):
        forgetting.add(np.ones(1))
    for _ in range(3):
        skipped.skip_frame()
    skipped.forget()
    whole.forget(frames=4)
    np.testing.assert_array_equal(skipped.sums, whole.sums)
    assert skipped.seconds(np.ones(1)) == whole.seconds(np.ones(1)) == pytest.approx(0.4)
    skipped.forget()
    assert skipped.seconds(np.ones(1)) == pytest.approx(0.1)
    forgetting = Forgetting((2, 3), 5.0, 1.0)
    forgetting.add(np.ones((2, 3)))
    forgetting.forget(1)
    forgetting.add(np.ones(3), 1)
    assert (forgetting.sums[0] == 1.0).all() and (forgetting.sums[1] > 1.0).all()
    np.testing.assert_array_equal(forgetting.with_prior(2.0, np.ones(3))[0], 3.0)


GRID = Grid((-1.0, 1.0), (-1.0, 1.0), 0.1, 1.8, 10)


def people(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(list(rows), [("x", float), ("y", float), ("height", float)])


def test_evidence_that_counts_twice_is_calibrated() -> None:
    """Log-odds twice too loud, learned on one half of the cells and judged on the other."""
    rng = np.random.default_rng(0)
    log_odds = rng.normal(0.0, 2.0, (2, 10, 60, 60))
    filled = rng.random(log_odds.shape) < expit(log_odds)
    loud, everywhere = (2 * log_odds).astype(np.float32), np.ones(log_odds.shape[1:], bool)
    reliability = cell_reliability.CellReliability.of([cell_reliability.count_cells(loud[0], filled[0], everywhere)])
    stated = reliability.of_cells(loud[1])
    for low in np.arange(0.0, 1.0, 0.1):
        of_bin = (stated >= low) & (stated < low + 0.1)
        assert filled[1][of_bin].mean() == pytest.approx(stated[of_bin].mean(), abs=0.03)
    assert (np.diff(reliability.probability) >= 0).all()


def test_cells_are_filled_in_doubt_or_a_half_where_uncounted() -> None:
    np.testing.assert_array_equal(cell_reliability.CellReliability.of([]).probability, 0.5)
    empty = cell_reliability.CellCounts(
        np.zeros(len(cell_reliability.LOG_ODDS_KNOTS)), np.zeros(len(cell_reliability.LOG_ODDS_KNOTS))
    )
    np.testing.assert_array_equal(cell_reliability.CellReliability.of([empty]).probability, 0.5)
    both = people((0.3, 0.3, 1.5), (-0.4, 0.0, 1.9))
    apart = [cell_reliability.filled_cells(GRID, both[k : k + 1]) for k in range(2)]
    np.testing.assert_array_equal(cell_reliability.filled_cells(GRID, both), apart[0] | apart[1])
    assert [cells.any((1, 2)).sum() for cells in apart] == [8, 10]
    # Seen cells: all within a metre of somebody, and elsewhere those of little evidence.
    log_odds = np.full(GRID.shape, -9.0, np.float32)
    log_odds[0, 0, :2] = 1.0, np.nan
    found = cell_reliability.doubtful_cells(GRID, log_odds, people((0.9, 0.9, 1.7)))
    assert found[0, 0, :3].tolist() == [True, False, False] and found[:, -1, -1].all()
    log_odds[:, -1, -1] = np.nan
    assert not cell_reliability.doubtful_cells(GRID, log_odds, people((0.9, 0.9, 1.7)))[:, -1, -1].any()


def test_of_a_run_file(tmp_path: Path) -> None:
    run = read_run(write_small_run(tmp_path / "night.h5"))
    probability, log_odds = run.read_cell_probability(12), small_volume()[0][2]
    np.testing.assert_array_equal(np.isnan(probability), np.isnan(log_odds))
    seen = ~np.isnan(log_odds)
    order = np.argsort(log_odds[seen])
    assert (np.diff(probability[seen][order]) >= 0).all() and 0 < probability[seen].mean() < 1


def test_a_track_has_the_median_of_sizes_that_are_measured() -> None:
    config = BodyConfig()
    open_sizes = Sizes.of_population(2, config)
    sizes = replace(open_sizes, height=np.array([1.6, 1.8]), height_variance=np.array([1e-3, config.height_spread**2]))
    height, width = sizes.measured(config)
    np.testing.assert_array_equal(height, [1.6, np.nan])
    assert np.isnan(width).all()
    rows = table_of(TRAJECTORY, frame=[0, 0, 1, 2, 3], id=[1, 2, 1, 1, 1], height=[1.6, np.nan, np.nan, 1.7, 1.75])
    assert with_heights(rows)["height"] == pytest.approx([1.6, BODY_HEIGHT, 1.7, 1.7, 1.75])
    np.testing.assert_array_equal(Tracks(rows).summary()["height"], np.array([1.7, np.nan], np.float32))


def test_a_reason_ends_with_a_whole_character() -> None:
    assert reason_of("camera " + 31 * "\u4e2d") == b"camera " + 29 * "\u4e2d".encode() and reason_of("a") == b"a"


def test_points_have_the_distance_of_their_cell() -> None:
    border = Border.of(room())
    grid, (rows, columns) = border.grid, border.distance.shape
    ground = grid.ground.reshape(-1, 2) + np.random.default_rng(0).uniform(-0.49, 0.49, (rows * columns, 2)) * grid.cell
    np.testing.assert_array_equal(border.away(ground), border.distance.reshape(-1))
    (left, right), (low, high) = grid.x, grid.y
    out = np.array([[left - 0.01, 0], [right + 0.01, 0], [0, low - 0.01], [0, high + 0.01], [-1e30, 1e30]])
    np.testing.assert_array_equal(border.away(out), 0.0)
    assert border.away(out[:0]).shape == (0,) and border.distance.max() > 1.0
