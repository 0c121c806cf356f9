"""Views that fail: informedness by its formula, who counts, when a view is left out and when it counts again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, boxes, likelihoods, looking, people, rig_of, room

from stseg import Tracker
from stseg.arrays import Boxes, Floats, Observation, ViewEvidence
from stseg.detection.detector import Detector
from stseg.noise.estimates import Estimates
from stseg.view_health.view_failures import informedness

STANDING = people((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75), (0.7, 0.9, 1.65))
RATE = 10.0
FAILED = 2


@given(st.integers(0, 2**32 - 1), st.integers(0, 4))
def test_informedness_by_its_formula(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    assignment = rng.integers(-1, number, (9, 11)).astype(np.int16)
    sure, foreground = rng.random(number) < 0.6, rng.random((9, 11)) < 0.5
    body = np.isin(assignment, np.flatnonzero(sure))
    counted, share = informedness(assignment, sure, foreground)
    assert counted == len(np.unique(assignment[body]))
    rest = foreground[assignment < 0]
    shares = [foreground[assignment == k].mean() for k in np.unique(assignment[body])]
    expected = np.mean(shares) - (rest.mean() if rest.size else 0.0) if counted else 0.0
    assert share == pytest.approx(expected)


def session(kind: str, views: int = 4) -> tuple[Detector, Estimates]:
    rig = replace(room(), frame_rate=RATE, cameras=room().cameras[:views])
    asked = Detector(rig, [kind] * views, FEW_HEIGHTS, BODY)
    return asked, asked.new_estimates()


def shown(kind: str, standing: Floats = STANDING, views: int = 4) -> list[ViewEvidence]:
    cameras = room().cameras[:views]
    return list(likelihoods(cameras, standing)) if kind == "pixels" else [boxes(camera, standing) for camera in cameras]


def explained(asked: Detector, learned: Estimates, seen: Sequence[ViewEvidence], frames: int) -> None:
    for _ in range(frames):
        asked.explain_next(learned, 0, seen, None)


def failed(kind: str, failure: str, seen: Sequence[ViewEvidence]) -> list[ViewEvidence]:
    if kind == "boxes":
        bad: ViewEvidence = Boxes(np.zeros((0, 4)), np.zeros(0))
    else:
        level = {"black": np.zeros, "white": np.ones}.get(failure, np.random.default_rng(3).random)
        bad = np.asarray(level(np.asarray(seen[FAILED]).shape), np.float32)
    return [bad if k == FAILED else own for k, own in enumerate(seen)]


@pytest.mark.parametrize(
    ("kind", "failure"), [("pixels", "black"), ("pixels", "white"), ("pixels", "noise"), ("boxes", "black")]
)
def test_a_view_that_fails_is_left_out_and_counts_again(kind: str, failure: str) -> None:
    (asked, learned), seen = session(kind), shown(kind)
    explained(asked, learned, seen, 10)
    assert not learned.failures.failing.any()
    explained(asked, learned, failed(kind, failure, seen), 5)
    assert learned.failures.failing.tolist() == [k == FAILED for k in range(4)]
    kept = learned.failures.kept(seen)
    assert [view is None for view in kept] == learned.failures.failing.tolist()
    explained(asked, learned, seen, 10)
    assert not learned.failures.failing.any()


def test_a_failed_view_counts_again_in_an_empty_scene() -> None:
    (asked, learned), seen = session("pixels"), shown("pixels")
    explained(asked, learned, seen, 10)
    explained(asked, learned, failed("pixels", "black", seen), 40)
    assert learned.failures.failing[FAILED]
    explained(asked, learned, shown("pixels", people()), 20)
    assert not learned.failures.failing.any()


def test_a_view_that_never_showed_people_does_not_fail() -> None:
    (asked, learned), seen = session("pixels"), shown("pixels")
    explained(asked, learned, failed("pixels", "black", seen), 40)
    assert not learned.failures.failing.any()


@pytest.mark.parametrize(("others", "failing"), [(3, False), (4, True)])
def test_a_view_that_never_showed_people_fails_beside_four(others: int, failing: bool) -> None:
    corner, *more = room().cameras
    rig = rig_of([corner, *more, looking("beside", (0.0, -3.6, 2.6))][: others + 1])
    asked = Detector(replace(rig, frame_rate=RATE), ["pixels"] * len(rig.cameras), FEW_HEIGHTS, BODY)
    learned, seen = asked.new_estimates(), list(likelihoods(rig.cameras, STANDING))
    half = [np.where(np.arange(view.shape[1]) % 2, view, 0.0).astype(np.float32) for view in map(np.asarray, seen)]
    explained(asked, learned, [half[0], *seen[1:]], 50)
    assert learned.failures.failing.tolist() == [failing] + [False] * others
    explained(asked, learned, seen, 10)
    assert not learned.failures.failing.any()


def test_of_two_views_neither_fails() -> None:
    asked, learned = session("pixels", 2)
    seen = shown("pixels", views=2)
    explained(asked, learned, seen, 10)
    explained(asked, learned, [seen[0], np.zeros_like(np.asarray(seen[1]))], 20)
    assert not learned.failures.failing.any()


def delivered(kind: str, standing: Floats) -> list[Observation]:
    if kind == "boxes":
        return [boxes(camera, standing) for camera in room().cameras]
    return [np.asarray(255 * (view > 0.5), np.uint8) for view in likelihoods(room().cameras, standing)]


def nothing(view: Observation) -> Observation:
    if isinstance(view, Boxes):
        return Boxes(np.zeros((0, 4)), np.zeros(0))
    return np.zeros_like(np.asarray(view, np.uint8))


def moved(frame: int) -> Floats:
    return np.asarray(STANDING + np.array([0.04, 0.02, 0.0]) * np.sin(0.3 * frame))


@pytest.mark.parametrize("kind", ["masks", "boxes"])
def test_a_run_says_from_when_to_when_a_view_is_left_out(kind: str) -> None:
    rig = replace(room(), frame_rate=RATE)
    tracker, results = Tracker(rig), []
    for frame in range(45):
        views = delivered(kind, moved(frame))
        if 15 <= frame < 30:
            views[FAILED] = nothing(views[FAILED])
        results += tracker.add(views)
    results += tracker.finish()
    events = np.concatenate([result.events for result in results])
    events = events[events["kind"] == b"blind"]
    name = rig.cameras[FAILED].name.encode()
    assert [name in reason for reason in events["reason"]] == [True, True]
    assert 15 <= events["frame"][0] < 20
    assert 30 < events["frame"][1] < 36
    assert b"excluded" in events["reason"][0]
    assert f"after {events['frame'][1] - events['frame'][0]} frames".encode() in events["reason"][1]
    assert len(tracker.tracks(results).summary()) == len(STANDING)
