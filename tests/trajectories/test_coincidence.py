"""Coincident tracks are one person; people side by side, and brief encounters, stay as they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from stseg.arrays import Rows
from stseg.records.tables import TRAJECTORY
from stseg.trajectories.coincidence import coincident

RATE = 10.0


def walk(track: int, first: int, stop: int, y: float, score: float) -> Rows:
    """A track along x, 0.1 m a frame."""
    rows = np.zeros(stop - first, TRAJECTORY)
    rows["frame"], rows["id"], rows["score"] = np.arange(first, stop), track, score
    rows["x"], rows["y"] = 0.1 * rows["frame"], y
    return rows


def test_the_weaker_of_two_coincident_tracks_is_dropped() -> None:
    rows = np.concatenate([walk(1, 0, 60, 0.0, 5.0), walk(2, 20, 45, 0.1, 3.0), walk(3, 0, 60, 0.6, 1.0)])
    repeats, events = coincident(rows, RATE, 1.0)
    assert set(rows["id"][repeats]) == {2} and repeats.sum() == 25
    (event,) = events
    assert (event["frame"], event["kind"], event["id"], event["other"]) == (20, b"dropped", 2, 1)
    assert event["reason"] == b"in one place with track 1 for 2.5 s: one person"


@pytest.mark.parametrize(("y", "length"), [(0.1, 9), (0.25, 40)])
def test_brief_encounters_and_neighbours_stay(y: float, length: int) -> None:
    rows = np.concatenate([walk(1, 0, 60, 0.0, 5.0), walk(2, 20, 20 + length, y, 3.0)])
    repeats, events = coincident(rows, RATE, 1.0)
    assert not repeats.any() and not len(events)


def test_no_track_and_rows_in_any_order() -> None:
    assert not len(coincident(np.zeros(0, TRAJECTORY), RATE, 1.0)[0])
    rows = np.concatenate([walk(2, 0, 30, 0.1, 9.0), walk(1, 0, 30, 0.0, 5.0)])
    shuffled = rows[np.random.default_rng(1).permutation(len(rows))]
    repeats, _ = coincident(shuffled, RATE, 1.0)
    assert set(shuffled["id"][repeats]) == {1} and repeats.sum() == 30


@pytest.mark.parametrize("seed", range(5))
def test_after_it_no_two_tracks_share_a_place_for_a_second(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = np.concatenate([walk(k, 0, 50, rng.uniform(0, 1), rng.normal()) for k in range(1, 7)])
    left = rows[~coincident(rows, RATE, 1.0)[0]]
    places = left[left["frame"] == 25]
    apart = cdist(places["y"][:, None], places["y"][:, None]) + np.diag(np.full(len(places), np.inf))
    assert apart.min(initial=np.inf) >= 0.12
