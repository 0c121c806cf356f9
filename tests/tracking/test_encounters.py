"""Scenes of people who come close: what happens in them, and that nobody is taken for somebody else."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations, islice, pairwise

import numpy as np
import pytest

from stseg.arrays import Bytes, Flags
from stseg.config import Config, TrackingConfig
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import run_session
from stseg.errors import ConfigError
from stseg.evaluation import evaluate
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.recording.frames import FrameSet
from stseg.kernels.accelerate import COMPILED
from stseg.records.tables import APPEARANCE
from stseg.simulation import NAMED, Route, SceneFilm, SceneSpec
from stseg.simulation.crowd.script import walk_routes
from stseg.simulation.film import RenderedFrame as Filmed
from stseg.tracking.windows.windows import windows

SCENES = ("crossing", "meeting", "meeting_heights", "border")
INTERPRETED = not COMPILED


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


# Routes


@pytest.mark.parametrize("stops", [(), ((0.0, 0.0, 0.0),), ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0))])
def test_a_route_is_a_way_through_time(stops: tuple[tuple[float, float, float], ...]) -> None:
    with pytest.raises(ConfigError, match=r"stops: .*rising times"):
        Route(1.7, stops)


def test_every_person_of_a_told_scene_has_a_route() -> None:
    with pytest.raises(ConfigError, match="routes: found 1, expected none, or 2"):
        replace(standing(), people=2)


def test_who_stands_stands_and_who_walks_swings_and_looks_ahead() -> None:
    crowds = list(walk_routes(standing((1.6, 1.8))))
    assert [len(crowd.id) for crowd in crowds] == [2] * 21 + [0] * 9
    still, walking = crowds[4], crowds[15]
    np.testing.assert_allclose(still.ground, [[0, 0], [0, 1]], atol=1e-9)
    np.testing.assert_allclose(walking.ground, [[0.5, 0], [0.5, 1]], atol=1e-9)
    np.testing.assert_allclose(still.swing, 0, atol=1e-9)
    np.testing.assert_allclose(walking.swing, 1, atol=1e-9)
    np.testing.assert_allclose(walking.heading, 0, atol=1e-9)
    np.testing.assert_array_equal(walking.height, [1.6, 1.8])


@pytest.mark.parametrize("name", SCENES)
def test_nobody_walks_through_anybody_or_faster_than_people_walk(name: str) -> None:
    spec = NAMED[name]
    before: dict[int, np.ndarray[tuple[int], np.dtype[np.float64]]] = {}
    for crowd in walk_routes(spec):
        for a, b in combinations(crowd.ground, 2):
            assert np.hypot(*(a - b)) > 0.39
        now = dict(zip(crowd.id.tolist(), crowd.ground, strict=True))
        for person in now.keys() & before.keys():
            assert np.hypot(*(now[person] - before[person])) * spec.frame_rate < 1.5
        before = now


def test_people_cross_at_less_than_half_a_metre() -> None:
    for pair in ((1, 2), (3, 4), (5, 6), (5, 7)):
        assert min(apart(NAMED["crossing"], *pair).values()) < 0.5


@pytest.mark.parametrize("name", ["meeting", "meeting_heights"])
def test_two_stand_together_for_ten_seconds_and_part(name: str) -> None:
    distance = np.array(list(apart(NAMED[name], 1, 2).values()))
    assert distance[33:134] == pytest.approx(0.5, abs=1e-6)
    assert distance[-1] > 3
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
    assert len(changes) >= 4
    assert all({frame - 1, frame} & shared for frame in changes)


# The whole way


@cache
def filmed(name: str, stop: int) -> tuple[Filmed, ...]:
    return tuple(islice(SceneFilm(NAMED[name]).frame_sets(), stop))


def switches(name: str, kind: str, stop: int) -> int:
    """How often somebody is taken for somebody else in the first frames of a scene."""
    rig, film = SceneFilm(NAMED[name]).rig, filmed(name, stop)
    pipeline = Pipeline(rig, [kind] * len(rig.cameras), Config(), "cut")
    if kind == "boxes":
        moments = [FrameSet(seen.frame, tuple(view.boxes for view in seen.views)) for seen in film]
    else:
        moments = [FrameSet(seen.frame, tuple(silhouette(view.instances > 0) for view in seen.views)) for seen in film]
    done: list[int] = []
    commits = [
        step.commit for step in run_session(pipeline, [ViewForeground() for _ in rig.cameras], moments, 0, done.append)
    ]
    rows, events = (np.concatenate([getattr(c, name) for c in commits]) for name in ("trajectory", "events"))
    tracks, _ = pipeline.finished(rows, events, np.zeros(0, APPEARANCE))
    scores = evaluate(np.concatenate([seen.truth for seen in film]), tracks.trajectory)
    assert scores.misses <= 0.02 * scores.truths
    return scores.switches


def silhouette(shown: Flags) -> Bytes:
    return np.where(shown, 255, 0).astype(np.uint8)


@pytest.mark.skipif(INTERPRETED, reason="whole scenes need the compiler")
@pytest.mark.parametrize("name", SCENES)
def test_nobody_is_taken_for_somebody_else_from_boxes(name: str) -> None:
    assert switches(name, "boxes", NAMED[name].frames) == 0


@pytest.mark.skipif(INTERPRETED, reason="whole scenes need the compiler")
@pytest.mark.parametrize("name", ["crossing", "border"])
def test_nobody_is_taken_for_somebody_else_from_silhouettes(name: str) -> None:
    """The first six seconds, in which people cross."""
    assert switches(name, "pixels", 60) == 0
