"""Who is who: windows that cover every frame once, assignments, tracklets, and identities over windows."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from checks import drawn, numbers
from hypothesis import strategies as st
from run_files import trajectory_of
from scenes import corner_cameras
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Flags, Rows
from stseg.bodies.pillars import BodyTable
from stseg.config import TrackingConfig
from stseg.geometry import Grid
from stseg.geometry.distances import distances
from stseg.geometry.nearest_person import nearest_person
from stseg.records.blobs import UNASSIGNED, Blobs
from stseg.segmentation.blobs import find_blobs
from stseg.segmentation.patches import GroundPatches, no_squares
from stseg.tracking.filter.assignment import assign
from stseg.tracking.windows.tracklets import Tracklet, form_tracklets
from stseg.tracking.windows.window_association import TrackAssociation, WindowAssignment
from stseg.tracking.windows.windows import LONGEST, SHORTEST, Window, window_length, windows
from stseg.trajectories.final_tracks import box_rows
from stseg.trajectories.pruning import drop_short
from stseg.trajectories.smoother import filled_gaps, interpolated_rows

RATE = 8.0
CONFIG = TrackingConfig()
GRID = Grid((-4.0, 4.0), (-4.0, 4.0), cell=0.2, planes=2)
WHOLE = GroundPatches.of(GRID, ~no_squares(GRID))
Path = dict[int, tuple[float, float]]
"""Where somebody is in each frame, metres; frames that it leaves out did not see them."""


RUNS = st.tuples(st.integers(0, 200), st.integers(1, 150)).map(lambda run: (run[0], run[0] + run[1]))


@drawn(300, RUNS, numbers(0.5, 60), numbers(0.1, 4))
def test_windows_partition_any_run(run: tuple[int, int], rate: float, seconds: float) -> None:
    first, stop = run
    config = TrackingConfig(window=seconds)
    length, shared = window_length(rate, config)
    assert SHORTEST <= length <= LONGEST and 1 <= shared < length
    parts = list(windows(rate, config, first, stop))
    assert [f for w in parts for f in range(w.commit_first, w.commit_stop)] == list(range(first, stop))
    for w in parts:
        assert first <= w.solve_first <= w.commit_first < w.commit_stop <= w.solve_stop <= stop
        assert w.solve_stop - w.solve_first <= length
        # What a window is does not depend on where the run begins or ends.
        start = w.index * (length - shared)
        assert (w.solve_first, w.solve_stop) == (max(start, first), min(start + length, stop))
    for before, after in pairwise(parts):
        assert after.index == before.index + 1
        assert after.solve_first < before.solve_stop  # they share frames


@drawn(100, RUNS, RUNS, numbers(0.5, 60))
def test_a_part_is_cut_where_the_whole_is(run: tuple[int, int], other: tuple[int, int], rate: float) -> None:
    first, stop = run
    whole = {w.index: w for w in windows(rate, CONFIG, 0, 400)}
    for w in windows(rate, CONFIG, first, stop):
        same = whole[w.index]
        assert w.commit_first in (first, same.commit_first) and w.commit_stop in (stop, same.commit_stop)
        if first <= same.solve_first and same.solve_stop < stop:
            assert w == same
    ended = list(windows(rate, CONFIG, first, other[1] + first))
    endless = windows(rate, CONFIG, first, 1 << 40)
    for w, open_ended in zip(ended[:-1], endless, strict=False):
        assert w == open_ended


@drawn(100, st.integers(0, 4), st.integers(0, 4), st.integers(0, 999))
def test_assignment_of_least_cost(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.uniform(0, 2, (rows, columns))
    cost[rng.random(cost.shape) < 0.2] = np.inf
    chosen, given_to = assign(cost, 1.0)
    assert len(set(chosen.tolist())) == len(chosen) == len(set(given_to.tolist()))
    assert (cost[chosen, given_to] < 1.0).all()
    paid = cost[chosen, given_to].sum() + (min(rows, columns) - len(chosen))
    least = np.minimum(cost, 1.0)
    assert paid == pytest.approx(least[linear_sum_assignment(least)].sum())


def test_distances_and_pieces_of_chains_where_they_were_seen() -> None:
    a, b = np.array([[0.0, 0.0], [3.0, 4.0]]), np.array([[3.0, 4.0], [0.0, 1.0], [3.0, 0.0]])
    np.testing.assert_allclose(distances(a, b), [[5, 1, 3], [0, np.hypot(3, 3), 4]])
    paths = [walk((-3, -1), (0.4, 0), FRAMES), walk((0, 2), (0.3, -0.1), FRAMES)]
    blobs, tracklets = tracklets_of(paths, FRAMES)
    assert sorted(tracklet.filter_track for tracklet in tracklets) == [1, 2]
    for tracklet in tracklets:
        assert tracklet.frames == list(FRAMES)
        for frame, blob, ground in zip(tracklet.frames, tracklet.blobs, tracklet.ground, strict=True):
            assert np.hypot(*(ground - paths[tracklet.filter_track - 1][frame])) < 0.15
            assert blobs[frame - FRAMES[0]].person[blob] >= 0
    path = walk((-2, 0), (0.4, 0), FRAMES)
    seen = {f: p for f, p in path.items() if 42 <= f < 50}
    rest = {f: p for f, p in path.items() if f not in seen}
    _, tracklets = tracklets_of([seen], FRAMES, unheld=[rest, dict.fromkeys(FRAMES, (2.0, -3.0))])
    assert [tracklet.frames for tracklet in tracklets] == [list(range(42, 50))]
    path = walk((-7, 0), (1.0, 0), FRAMES)
    before = {f: p for f, p in path.items() if f < 45}
    after = {f: p for f, p in path.items() if f >= 47}
    _, tracklets = tracklets_of([before, after], FRAMES, chain=[3, 3])
    assert [(one.filter_track, one.frames) for one in tracklets] == [(3, [*range(40, 45), *range(47, 52)])]
    _, tracklets = tracklets_of([before, after], FRAMES, chain=[3, 4])  # two who are followed are two
    assert [tracklet.filter_track for tracklet in tracklets] == [3, 4]


def walk(start: Sequence[float], velocity: Sequence[float], frames: range) -> Path:
    """Constant velocity in metres per second."""
    dt = 1 / RATE
    return {f: (start[0] + velocity[0] * f * dt, start[1] + velocity[1] * f * dt) for f in frames}


def column(places: Sequence[tuple[float, float]]) -> Flags:
    """Cells within 0.3 m of somebody, bool (plane, y, x)."""
    occupied = np.zeros(GRID.shape, bool)
    if places:
        away = np.hypot(*np.moveaxis(GRID.ground[:, :, None] - np.array(places), -1, 0)).min(2)
        occupied[:] = away <= 0.3
    return occupied


def blobs_in(
    paths: Sequence[Path], frame: int, unheld: Sequence[Path] = (), chain: Sequence[int] | None = None
) -> Blobs:
    """Blobs of one frame: people of `paths`, and cells along `unheld` where the frame's pass saw nobody."""
    names = np.array(chain or range(1, len(paths) + 1))[[frame in path for path in paths]]
    held = np.array([path[frame] for path in paths if frame in path]).reshape(-1, 2)
    occupied = column([*map(tuple, held), *(path[frame] for path in unheld if frame in path)])
    owner = np.append(names, UNASSIGNED)[nearest_person(GRID.ground, held, 0.4)]
    label = np.where(occupied, owner, 0).astype(np.int32)
    log_odds = np.where(occupied, 2.0, -2.0).astype(np.float32)
    return find_blobs(label, log_odds, held, names, 0.4, WHOLE)


def tracklets_of(
    paths: Sequence[Path], frames: range, unheld: Sequence[Path] = (), chain: Sequence[int] | None = None
) -> tuple[list[Blobs], list[Tracklet]]:
    """Blobs and tracklets of some frames; each path is a chain of its own unless `chain` says otherwise."""
    blobs = [blobs_in(paths, frame, unheld, chain) for frame in frames]
    return blobs, form_tracklets(blobs, frames[0])


FRAMES = range(40, 52)


HALF = 4
"""Frames that two windows of these tests share."""


def decide(
    identities: TrackAssociation, paths: Sequence[Path], stop: int, chain: Sequence[int] | None = None
) -> tuple[list[Window], list[WindowAssignment], dict[tuple[int, int], int]]:
    """Run windows of eight frames over paths; the identity of each path in each committed frame."""
    made: list[Window] = []
    decisions: list[WindowAssignment] = []
    names: dict[tuple[int, int], int] = {}
    for index, start in enumerate(range(0, stop - HALF, 8 - HALF)):
        end = start + 8
        last = end >= stop
        commit = (0 if index == 0 else start + 2, stop if last else end - 2)
        window = Window(index, start, min(end, stop), *commit)
        frames = range(window.solve_first, window.solve_stop)
        blobs, tracklets = tracklets_of(paths, frames, chain=chain)
        decision = identities.decide(window, blobs, tracklets)
        for frame in range(*commit):
            found = blobs[frame - start]
            standing = [k for k, path in enumerate(paths) if frame in path]
            for blob, person in enumerate(found.person):
                if person >= 0:
                    names[standing[person], frame] = int(decision.identity[frame - start][blob])
        made.append(window)
        decisions.append(decision)
    return made, decisions, names


def ids_of(names: dict[tuple[int, int], int], path: int) -> list[int]:
    """Identities of a path, in the order of time, each run of equal ones once."""
    found = [name for (k, _), name in sorted(names.items()) if k == path]
    return [name for k, name in enumerate(found) if k == 0 or name != found[k - 1]]


def events_of(decisions: Sequence[WindowAssignment], kind: str) -> list[tuple[int, int, int]]:
    return [(f, i, other) for d in decisions for f, k, i, other, _ in d.events if k == kind]


def test_identities_last_and_follow_the_cells_not_chains() -> None:
    frames = range(32)
    paths = [walk((-3, -1), (0.5, 0), frames), walk((3, 1), (-0.5, 0), frames)]
    windows_made, decisions, names = decide(TrackAssociation(RATE, CONFIG), paths, 32)
    assert len(windows_made) == 7
    assert len(names) == 64 and sorted([ids_of(names, 0), ids_of(names, 1)]) == [[1], [2]]
    assert events_of(decisions, "birth") == [(0, 1, 0), (0, 2, 0)]
    assert all(kind == "birth" for d in decisions for _, kind, *_ in d.events)
    assert all(reason for d in decisions for *_, reason in d.events)
    # Chains that begin anew in each window: what two windows share tells.
    frames = range(24)
    identities = TrackAssociation(RATE, CONFIG)
    found = []
    for index, start in enumerate(range(0, 20, 4)):
        window = Window(index, start, start + 8, start + 2 if index else 0, start + 6)
        part = range(start, start + 8)
        blobs, tracklets = tracklets_of(paths, part, chain=[10 * index + 100, 10 * index + 101])
        decision = identities.decide(window, blobs, tracklets)
        found.append([int(decision.identity[3][blobs[3].person.tolist().index(k)]) for k in range(2)])
    assert all(pair == found[0] for pair in found) and sorted(found[0]) == [1, 2]


def test_birth_death_and_who_is_found_again() -> None:
    stays = walk((-3, -1), (0.3, 0), range(40))
    leaves = walk((3, 1), (0.1, 0), range(11))
    comes = walk((0, 3), (0.2, 0), range(17, 40))
    _, decisions, names = decide(TrackAssociation(RATE, CONFIG), [stays, leaves, comes], 40)
    ids = [ids_of(names, k) for k in range(3)]
    assert [len(i) for i in ids] == [1, 1, 1] and len({i[0] for i in ids}) == 3
    assert [(f, i) for f, i, _ in events_of(decisions, "birth")][2:] == [(17, ids[2][0])]
    assert events_of(decisions, "death") == [(10, ids[1][0], 0)]
    path = walk((-3, 0), (0.5, 0), range(40))
    seen = {f: p for f, p in path.items() if f not in range(13, 19)}
    _, decisions, names = decide(TrackAssociation(RATE, CONFIG), [seen], 40)
    assert set(names.values()) == {1}
    assert len(events_of(decisions, "birth")) == 1 and not events_of(decisions, "death")


def test_merge_split_and_short_tracks_that_go() -> None:
    """Two people come within a step of each other and part."""
    frames = range(32)
    near = {f: 0.25 + 0.13 * abs(f - 16) for f in frames}
    paths: list[Path] = [{f: (-near[f], 0.1) for f in frames}, {f: (near[f], 0.1) for f in frames}]
    _, decisions, names = decide(TrackAssociation(RATE, CONFIG), paths, 32)
    assert [len(ids_of(names, k)) for k in range(2)] == [1, 1]
    merges, splits = events_of(decisions, "merge"), events_of(decisions, "split")
    assert {(i, other) for _, i, other in [*merges, *splits]} == {(1, 2)}
    told = [f for (first, *_), (last, *_) in zip(merges, splits, strict=True) for f in range(first, last + 1)]
    assert told == [f for f in frames if len(blobs_in(paths, f).touches)]
    least = round(CONFIG.minimum_duration * RATE)
    rows = rows_of({1: walk((0, 0), (0, 0), range(5, 5 + least)), 2: walk((2, 0), (0, 0), range(7, 6 + least))})
    kept, events = drop_short(rows, RATE, CONFIG)
    assert kept.tolist() == [1]
    assert [(e["frame"], e["kind"], e["id"], e["other"]) for e in events] == [(7, b"dropped", 2, 0)]
    assert events["reason"][0]
    assert [len(one) for one in drop_short(rows[:0], RATE, CONFIG)] == [0, 0]


@drawn(24, st.integers(0, 999))
def test_events_are_of_committed_frames_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walks = (walk(rng.uniform(-1.5, 1.5, 2).tolist(), rng.uniform(-0.5, 0.5, 2).tolist(), range(40)) for _ in range(4))
    paths = [{f: p for f, p in path.items() if rng.random() < 0.8} for path in walks]
    made, decisions, names = decide(TrackAssociation(RATE, CONFIG), paths, 40)
    for window, decision in zip(made, decisions, strict=True):
        assert decision.events == sorted(decision.events)
        for frame, kind, *_ in decision.events:
            assert frame < window.commit_stop
            assert frame >= window.commit_first or kind == "death"
        assert len(decision.identity) == window.solve_stop - window.solve_first
        for identity in decision.identity:
            named = identity[identity > 0]
            assert len(np.unique(named)) == len(named)  # nobody is in two places
    for frame in range(40):
        there = [(k, path[frame]) for k, path in enumerate(paths) if frame in path]
        for k, place in there:  # whoever stands more than a cell from all others has cells, so a name
            assert (k, frame) in names or any(0 < np.hypot(*np.subtract(place, other)) < 0.3 for _, other in there)
    born = [i for _, i, _ in events_of(decisions, "birth")]
    assert len(set(born)) == len(born) and set(names.values()) == set(born)


def rows_of(paths: dict[int, Path]) -> Rows:
    """TRAJECTORY rows, sorted by frame, then id."""
    rows = trajectory_of(*sorted((f, i, *place) for i, path in paths.items() for f, place in path.items()))
    rows["raw_x"], rows["raw_y"], rows["xx"], rows["yy"] = rows["x"], rows["y"], 0.01, 0.01
    return rows


@drawn(100, st.sets(st.integers(0, 30), min_size=2), st.sets(st.integers(0, 30), min_size=1))
def test_short_gaps_are_filled_on_straight_lines(first: set[int], second: set[int]) -> None:
    whole = {4: walk((0, 1), (0.5, -0.3), range(31)), 2: walk((3, 3), (0, 0), range(31))}
    seen = rows_of({i: {f: whole[i][f] for f in frames} for i, frames in ((4, first), (2, second))})
    filled = filled_gaps(seen, interpolated_rows(seen, RATE, CONFIG))
    for i, frames in ((4, first), (2, second)):
        own = filled[filled["id"] == i]
        gaps = [range(a + 1, b) for a, b in pairwise(sorted(frames))]
        short = [f for gap in gaps if len(gap) <= CONFIG.interpolation_gap * RATE for f in gap]
        assert own["frame"].tolist() == sorted([*frames, *short])
        walked = np.column_stack([own["x"], own["y"]])
        np.testing.assert_allclose(walked, [whole[i][f] for f in own["frame"]], atol=1e-9)
        unseen = ~np.isin(own["frame"], list(frames))
        assert (np.isnan(own["raw_x"]) == unseen).all() and (np.isnan(own["raw_y"]) == unseen).all()
        assert (own["xx"][unseen] > 0.01).all() and (own["xx"][~unseen] == 0.01).all()
        assert (np.isnan(own["height"]) == unseen).all() and np.isnan(own["width"][unseen]).all()
    keys = [(row["frame"], row["id"]) for row in filled]
    assert keys == sorted(keys)
    again = interpolated_rows(filled, RATE, CONFIG)
    assert len(again) == len(interpolated_rows(seen[:0], RATE, CONFIG)) == 0


def test_boxes_of_tracks_lie_in_the_images() -> None:
    cameras = corner_cameras()
    tables = [BodyTable.of(camera, Grid((-2, 2), (-2, 2))) for camera in cameras]
    rows = rows_of({3: walk((-1.5, -1), (0.5, 0.2), range(6)), 5: {2: (0.0, 0.0)}})
    boxes = box_rows(tables, rows)
    keys = [(b["frame"], b["id"], b["view"]) for b in boxes]
    assert keys == sorted(keys) and len(set(keys)) == len(keys) == 4 * len(rows)
    for box in boxes:
        assert 0 <= box["left"] < box["left"] + box["width"] <= cameras[box["view"]].size[0]
        assert 0 <= box["top"] < box["top"] + box["height"] <= cameras[box["view"]].size[1]
    middle = next(b for b in boxes if b["id"] == 5 and b["view"] == 1)
    pixel, _ = cameras[1].project(np.zeros((1, 2)), 0.9)
    assert np.abs(pixel[0] - (middle["left"] + middle["width"] / 2, middle["top"] + middle["height"] / 2)).max() < 3
    assert len(box_rows(tables, rows[:0])) == 0
    gap = rows.copy()
    gap["height"][(gap["id"] == 5) | (gap["frame"] == 3)] = np.nan
    np.testing.assert_array_equal(box_rows(tables, gap), boxes)
