"""The tracks of a whole run: events told again, tracks dropped, long gaps kept, raw places beside the smoothed."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from strollers import BORDER, CONFIG, RATE, gone, rows_of, runs, swapped, visit

from stseg.arrays import Rows
from stseg.records.tables import APPEARANCE, EVENT, TRAJECTORY
from stseg.trajectories.final_tracks import FinalTracks, final_tracks


def committed(rows: Rows) -> Rows:
    """Rows as a tracker commits them: what the frame says is all that is known."""
    told = rows.copy()
    told["raw_x"], told["raw_y"] = rows["x"], rows["y"]
    told["xx"] = told["yy"] = 0.02
    told["extent"] = 0.5
    return told


def told(*events: tuple[int, str, int, int]) -> Rows:
    """EVENT rows."""
    return np.array([(f, kind.encode(), i, other, b"so it was") for f, kind, i, other in events], EVENT)


def lives(rows: Rows) -> Rows:
    """Birth and death of every track, in order."""
    spans = [(int(i), rows["frame"][rows["id"] == i]) for i in np.unique(rows["id"])]
    born = [(int(frames.min()), "birth", i, 0) for i, frames in spans]
    return told(*sorted(born + [(int(frames.max()), "death", i, 0) for i, frames in spans]))


def whole(rows: Rows, events: Rows) -> FinalTracks:
    return final_tracks(rows, events, np.zeros(0, APPEARANCE), RATE, BORDER, CONFIG)


def story(events: Rows) -> list[tuple[int, bytes, int, int]]:
    return [(int(e["frame"]), bytes(e["kind"]), int(e["id"]), int(e["other"])) for e in events]


def test_who_is_found_again_was_neither_dead_nor_born() -> None:
    rows = committed(gone(2.0))
    found = whole(rows, lives(rows))
    assert story(found.events) == [(0, b"birth", 1, 0), (40, b"hand-over", 1, 2), (63, b"death", 1, 0)]
    assert found.events["reason"].tolist()[0] == b"so it was"
    assert b"m away, " in found.events["reason"].tolist()[1]
    assert set(found.identity.tolist()) == {1}


def test_births_and_deaths_beyond_the_border_are_at_end_rows() -> None:
    rows = committed(rows_of({1: (visit(-1), 1.7, range(3, 60))}, noise=0.0))
    beyond = told((0, "birth", 1, 0), (1, "birth", 2, 0), (2, "death", 2, 0), (62, "death", 1, 0))
    assert story(whole(rows, beyond).events) == [(3, b"birth", 1, 0), (59, b"death", 1, 0)]


def test_a_gap_longer_than_the_bridge_stays() -> None:
    long, short = whole(committed(gone(2.0)), told()), whole(committed(gone(0.5)), told())
    assert long.trajectory["frame"].tolist() == [*range(24), *range(40, 64)]
    assert short.trajectory["frame"].tolist() == list(range(52))
    filled = np.isin(short.trajectory["frame"], range(24, 28))
    assert (short.trajectory["extent"] > 0).tolist() == (~filled).tolist()


def test_a_swap_is_told_under_the_names_that_are_right() -> None:
    true = rows_of({1: (visit(-1), 1.7, range(160)), 2: (visit(1), 1.85, range(160))}, noise=0.0)
    rows = committed(swapped(true, 80))
    found = whole(
        rows, np.sort(np.concatenate([lives(rows), told((70, "merge", 1, 2), (95, "split", 1, 2))]), order="frame")
    )
    apart = ~np.isin(true["frame"], range(72, 89))
    np.testing.assert_array_equal(found.identity[apart], true["id"][apart])
    passed = [one for one in story(found.events) if one[1] == b"hand-over"]
    assert sorted(identity for _, _, identity, _ in passed) == [1, 2]
    assert all(72 <= frame < 89 and other == 3 - identity for frame, _, identity, other in passed)
    assert [one for one in story(found.events) if one[1] != b"hand-over"] == [
        (0, b"birth", 1, 0),
        (0, b"birth", 2, 0),
        (70, b"merge", 1, 2),
        (96, b"split", 1, 2),
        (159, b"death", 2, 0),
        (159, b"death", 1, 0),
    ]


def test_rows_of_dropped_tracks_have_no_identity() -> None:
    def here(_: float) -> tuple[float, float]:
        return 1.0, -2.0

    rows = committed(rows_of({5: (visit(1), 1.7, range(40)), 7: (here, 1.7, range(10, 13))}))
    found = whole(rows, told())
    assert found.identity.tolist() == np.where(rows["id"] == 5, 5, 0).tolist()
    assert story(found.events) == [(10, b"dropped", 7, 0)]
    assert set(found.trajectory["id"].tolist()) == {5}


def test_raw_places_stay_beside_the_smoothed() -> None:
    rows = committed(rows_of({3: (visit(1), 1.7, range(60))}, noise=0.1))
    found = whole(rows, told()).trajectory
    np.testing.assert_array_equal(found["raw_x"], rows["x"])
    np.testing.assert_array_equal(found["raw_y"], rows["y"])
    assert (found["x"] != rows["x"]).all()
    assert (found["xx"] < rows["xx"]).all()


@settings(max_examples=60, deadline=None)
@given(runs(5))
def test_any_run_is_told_without_contradiction(drawn: Rows) -> None:
    rows = committed(drawn)
    found = whole(rows, lives(rows))
    track = found.trajectory
    keys = list(zip(track["frame"].tolist(), track["id"].tolist(), strict=True))
    assert keys == sorted(set(keys))
    kept = found.identity > 0
    assert set(zip(rows["frame"][kept].tolist(), found.identity[kept].tolist(), strict=True)) <= set(keys)
    assert (np.diff(found.events["frame"]) >= 0).all()
    for frame, kind, identity, _ in story(found.events):
        own = track["frame"][track["id"] == identity]
        if len(own) and kind == b"birth":
            assert frame == own.min()
        if len(own) and kind == b"death":
            assert frame == own.max()
    assert all(found.events["reason"].tolist())


def test_nobody_at_all() -> None:
    found = whole(np.zeros(0, TRAJECTORY), told())
    assert len(found.trajectory) == len(found.events) == len(found.identity) == 0
