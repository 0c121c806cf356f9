"""The area and its border, encounters of tracks and their events."""

from dataclasses import replace
from functools import cache
from itertools import combinations, islice, pairwise

import numpy as np
import pytest
from checks import compiled_only, drawn, in_ci, refused
from hypothesis import strategies as st
from scenes import boxes, found, people, room

from stseg import Config, FrameSet, Grid, Rig, Tracker, evaluate
from stseg.arrays import Floats, Observation, Rows
from stseg.config import TrackingConfig
from stseg.engine.committed_frames import within_area
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import run_session
from stseg.errors import ConfigError
from stseg.foreground.view_foreground import ViewForeground
from stseg.records.blobs import Blobs
from stseg.records.sparse_labels import SparseLabels
from stseg.records.sparse_volume import SparseVolume
from stseg.records.tables import APPEARANCE, EVENT, TRAJECTORY, WINDOW
from stseg.simulation import NAMED, Route, SceneFilm, SceneSpec
from stseg.simulation.crowd.script import walk_routes
from stseg.simulation.film import RenderedFrame as Filmed
from stseg.trackers import Commit, FusedFrame
from stseg.trackers.rows import event_rows
from stseg.tracking.windows.encounters import encounters, touches
from stseg.tracking.windows.windows import windows
from stseg.trajectories.final_tracks import CommittedRows

SCENES = ("crossing", "meeting", "meeting_heights", "border")


def standing(heights: tuple[float, ...] = (1.7,)) -> SceneSpec:
    routes = tuple(Route(height, ((0.0, 0.0, k), (1.0, 0.0, k), (2.0, 1.0, k))) for k, height in enumerate(heights))
    return replace(NAMED["tiny"], people=len(routes), routes=routes, seconds=3.0)


def apart(spec: SceneSpec, one: int, other: int) -> dict[int, float]:
    """Metres between two people in the frames in which both are there."""
    found = {}
    for crowd in walk_routes(spec):
        if {one, other} <= set(crowd.id.tolist()):
            ground = dict(zip(crowd.id.tolist(), crowd.ground, strict=True))
            found[crowd.frame] = float(np.hypot(*(ground[one] - ground[other])))
    return found


@pytest.mark.parametrize("stops", [(), ((0.0, 0.0, 0.0),), ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0))])
def test_a_route_is_a_way_through_time(stops: tuple[tuple[float, float, float], ...]) -> None:
    refused(ConfigError, r"stops: .*rising times", Route, 1.7, stops)
    refused(ConfigError, "routes: found 1, expected none, or 2", replace, standing(), people=2)


def test_people_stand_swing_look_ahead_and_cross_closely() -> None:
    crowds = list(walk_routes(standing((1.6, 1.8))))
    assert [len(crowd.id) for crowd in crowds] == [2] * 21 + [0] * 9
    still, walking = crowds[4], crowds[15]
    np.testing.assert_allclose(still.ground, [[0, 0], [0, 1]], atol=1e-9)
    np.testing.assert_allclose(walking.ground, [[0.5, 0], [0.5, 1]], atol=1e-9)
    np.testing.assert_allclose(still.swing, 0, atol=1e-9)
    np.testing.assert_allclose(walking.swing, 1, atol=1e-9)
    np.testing.assert_allclose(walking.heading, 0, atol=1e-9)
    np.testing.assert_array_equal(walking.height, [1.6, 1.8])
    for pair in ((1, 2), (3, 4), (5, 6), (5, 7)):
        assert min(apart(NAMED["crossing"], *pair).values()) < 0.5


@pytest.mark.parametrize("name", SCENES)
def test_nobody_walks_through_anybody_or_faster_than_people_walk(name: str) -> None:
    spec = NAMED[name]
    before: dict[int, np.ndarray[tuple[int], np.dtype[np.float64]]] = {}
    crowds = list(walk_routes(spec))
    assert len(crowds) == spec.frames
    for crowd in crowds:
        for a, b in combinations(crowd.ground, 2):
            assert np.hypot(*(a - b)) > 0.39
        now = dict(zip(crowd.id.tolist(), crowd.ground, strict=True))
        for person in now.keys() & before.keys():
            assert np.hypot(*(now[person] - before[person])) * spec.frame_rate < 1.5
        before = now


@pytest.mark.parametrize("name", ["meeting", "meeting_heights"])
def test_two_stand_together_for_ten_seconds_and_part(name: str) -> None:
    distance = np.array(list(apart(NAMED[name], 1, 2).values()))
    assert distance[33:134] == pytest.approx(0.5, abs=1e-6) and distance[-1] > 3
    heights = [route.height for route in NAMED[name].routes]
    assert abs(heights[1] - heights[0]) == pytest.approx(0.08 if name == "meeting_heights" else 0.0)


def test_things_happen_where_windows_end() -> None:
    spec = NAMED["border"]
    solved = list(windows(spec.frame_rate, TrackingConfig(), 0, spec.frames))
    ends = {window.commit_stop for window in solved}
    shared = {f for a, b in pairwise(solved) for f in range(b.solve_first, a.solve_stop)}
    distance = apart(spec, 1, 2)
    assert min(distance, key=lambda frame: distance[frame]) in ends
    meeting = [frame for frame, metres in apart(spec, 3, 4).items() if metres < 0.52]
    assert min(abs(meeting[0] - end) for end in ends) <= 2
    assert min(abs(meeting[-1] - end) for end in ends) <= 2
    inside: list[set[int]] = [set(crowd.truth(spec.area)["id"].tolist()) for crowd in walk_routes(spec)]
    changes = [frame for frame in range(1, spec.frames) if inside[frame] != inside[frame - 1]]
    assert len(changes) >= 4 and all({frame - 1, frame} & shared for frame in changes)


@cache
def filmed(name: str, stop: int) -> tuple[Filmed, ...]:
    return tuple(islice(SceneFilm(NAMED[name]).frame_sets(), stop))


def switches(name: str, kind: str, stop: int) -> int:
    """How often somebody is taken for somebody else in the first frames of a scene."""
    rig, film = SceneFilm(NAMED[name]).rig, filmed(name, stop)
    pipeline = Pipeline(rig, [kind] * len(rig.cameras), Config(), "cut")
    frames = [FrameSet(one.frame, tuple(v.boxes if kind == "boxes" else v.mask for v in one.views)) for one in film]
    foreground = [ViewForeground() for _ in rig.cameras]
    commits = [step.commit for step in run_session(pipeline, foreground, frames, 0, lambda _: None)]
    rows, events = (np.concatenate([getattr(c, name) for c in commits]) for name in ("trajectory", "events"))
    tracks, _ = pipeline.finished(CommittedRows(rows, events, np.zeros(0, APPEARANCE)))
    scores = evaluate(np.concatenate([seen.truth for seen in film]), tracks.trajectory)
    assert scores.misses <= 0.02 * scores.truths
    return scores.switches


@compiled_only
@pytest.mark.parametrize(
    ("name", "kind"), [("crossing", "pixels"), *in_ci(("border", "pixels"), *((name, "boxes") for name in SCENES))]
)
def test_nobody_is_taken_for_somebody_else(name: str, kind: str) -> None:
    """From boxes, and from silhouettes of the first six seconds, in which people cross."""
    assert switches(name, kind, 60 if kind == "pixels" else NAMED[name].frames) == 0


LENGTH, RATE = 30, 5.0


def frame_of(pairs: set[tuple[int, int]]) -> Blobs:
    """Four blobs, of which these touch."""
    names = np.zeros(4, np.int64)
    touching = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    return Blobs(np.zeros((1, 1), np.int32), names, names, np.zeros((4, 2)), np.zeros(4), touching)


def told(touching: list[set[tuple[int, int]]], names: list[int], cuts: list[int]) -> Rows:
    """What windows that are cut there tell; the blobs' names stay."""
    rows = []
    for first, stop in pairwise(sorted({0, *cuts, LENGTH})):
        blobs = [frame_of(pairs) for pairs in touching[first:stop]]
        rows += touches(first, blobs, [np.array(names)] * len(blobs))
    return event_rows(sorted(rows))


def same(track: int, _: int) -> int:
    return track


def plain(touching: list[set[tuple[int, int]]], names: list[int], parting: int) -> list[tuple[int, bytes, int, int]]:
    found = []
    for a, b in {tuple(sorted((names[i], names[j]))) for pairs in touching for i, j in pairs}:
        frames = [f for f, met in enumerate(touching) if {a, b} in [{names[i], names[j]} for i, j in met]]
        for k, frame in enumerate(frames):
            if a > 0 and (k == 0 or frame - frames[k - 1] - 1 > parting):
                found.append((frame, b"merge", a, b))
            if a > 0 and frame < LENGTH - 1 and (k + 1 == len(frames) or frames[k + 1] - frame - 1 > parting):
                found.append((frame + 1, b"split", a, b))
    return sorted(found)


PAIRS = st.sets(st.sampled_from([(0, 1), (0, 2), (1, 3), (2, 3)]), max_size=3)


@drawn(80, st.lists(PAIRS, min_size=LENGTH, max_size=LENGTH), st.permutations([0, 1, 2, 7]),
    st.lists(st.integers(1, LENGTH - 1), max_size=5), st.integers(0, 6),
)  # fmt: skip
def test_encounters_do_not_depend_on_the_windows(
    touching: list[set[tuple[int, int]]], names: list[int], cuts: list[int], parting: int
) -> None:
    found = encounters(told(touching, names, cuts), same, parting, RATE, LENGTH - 1)
    assert found[["frame", "kind", "id", "other"]].tolist() == plain(touching, names, parting)


def test_encounters_are_under_new_names_and_of_their_length() -> None:
    touching = [{(0, 1), (2, 3)} if f < 10 else set() for f in range(LENGTH)]
    rows = told(touching, [1, 2, 3, 4], [5])

    def name(track: int, frame: int) -> int:
        return {1: 9 if frame < 5 else 6, 2: 2, 3: 8, 4: 8}[track]

    found = encounters(rows, name, 2, RATE, LENGTH - 1)
    assert [(f, i, o) for f, kind, i, o, _ in found.tolist() if kind == b"merge"] == [(0, 2, 9), (5, 2, 6)]
    assert not len(encounters(rows, lambda _, __: 0, 2, RATE, LENGTH - 1))
    touching = [{(0, 1)} if 3 <= f < 13 and f != 8 else set() for f in range(LENGTH)]
    merge, split = encounters(told(touching, [1, 2, 3, 4], [6]), same, 2, RATE, LENGTH - 1)
    assert (merge["frame"], merge["reason"]) == (3, b"their cells touch, for 2.0 s")
    assert split["frame"] == 13


FIRST, PLACES = 7, [(0.1, 0.0), (-0.2, 0.5), (1.02, 0.2), (-0.4, -1.01)]
TRIANGLE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)])


def commit_of(rig: Rig) -> Commit:
    """Two frames in each of which tracks 1, 2, ... are at PLACES, and have a cell each."""
    rows = np.zeros(2 * len(PLACES), TRAJECTORY)
    rows["frame"] = np.repeat([FIRST, FIRST + 1], len(PLACES))
    rows["id"] = np.tile(np.arange(1, len(PLACES) + 1), 2)
    rows["x"], rows["y"] = np.tile(np.array(PLACES), (2, 1)).T
    rows["x"][-2] = 0.98  # in its second frame the third is back
    label = np.zeros((2, *rig.grid.shape), np.int32)
    label[:, 0, 0, : len(PLACES)] = np.arange(1, len(PLACES) + 1)
    nobody, empty = found(people()), SparseVolume.whole(np.zeros(rig.grid.shape, np.float32))
    frames = [FusedFrame(frame, nobody, nobody, empty) for frame in (FIRST, FIRST + 1)]
    return Commit(frames, [SparseLabels.whole(one) for one in label], rows, np.zeros(0, EVENT), np.zeros(0, WINDOW))


@pytest.mark.parametrize(
    ("polygon", "closed", "inside"),
    [(None, False, [[1, 2], [1, 2, 3]]), (TRIANGLE, False, [[1], [1, 3]]), (None, True, [[1, 2, 3, 4], [1, 2, 3, 4]])],
    ids=["rectangle", "polygon", "closed"],
)
def test_rows_and_labels_are_of_people_inside(polygon: Floats | None, closed: bool, inside: list[list[int]]) -> None:
    rig = replace(room(), grid=Grid(x=(-1.0, 1.0), y=(-1.0, 1.0), planes=2, polygon=polygon), closed=closed)
    whole = commit_of(rig)
    kept = within_area(whole, rig)
    for k, ids in enumerate(inside):
        rows = kept.trajectory[kept.trajectory["frame"] == FIRST + k]
        assert rows["id"].tolist() == ids and np.setdiff1d(kept.label[k], [0]).tolist() == ids
    assert np.setdiff1d(whole.label, [0]).tolist() == [1, 2, 3, 4]  # what a tracker holds is not changed


def test_who_walks_out_is_tracked_up_to_the_border() -> None:
    rig = replace(room(), frame_rate=10.0)
    edge, tracker, results = rig.grid.x[1], Tracker(rig), []
    places = [np.array([[edge - 0.8 + 0.05 * frame, 0.3, 1.7], [0.2, -0.9, 1.7]]) for frame in range(26)]
    for standing in places:
        views: list[Observation] = [boxes(camera, standing) for camera in rig.cameras]
        results += tracker.add(views)
    results += tracker.finish()
    rows = np.concatenate([result.trajectory for result in results])
    assert rig.grid.contains(np.stack([rows["x"], rows["y"]], -1)).all()
    walker = rows[rows["y"] > 0]
    true = np.array([standing[0, 0] for standing in places])
    assert walker["frame"].tolist() == np.flatnonzero(true < edge - 0.025).tolist()
