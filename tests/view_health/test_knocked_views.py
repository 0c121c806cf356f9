"""Knocked views: found in their first frame, in pixels and in boxes, by nothing that other views show too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import BODY, FEW_HEIGHTS, boxes, expecting, likelihoods, people, room

from stseg import Tracker
from stseg.arrays import Boxes, Bytes, Floats, Observation, ViewEvidence
from stseg.config import ErrorRateConfig
from stseg.detection.detector import Detector
from stseg.view_health.knocked_views import KnockedViews, _fill_found

STANDING = people((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75), (0.7, 0.9, 1.65))
RATE, KNOCKED = 10.0, 2
KINDS = ("pixels", "boxes")


def shown(kind: str, standing: Floats = STANDING, views: int = 4) -> list[ViewEvidence]:
    cameras = room().cameras[:views]
    return list(likelihoods(cameras, standing)) if kind == "pixels" else [boxes(camera, standing) for camera in cameras]


def aside(view: ViewEvidence, pixels: int) -> ViewEvidence:
    """What a camera shows that is pushed aside."""
    if isinstance(view, Boxes):
        return replace(view, pixel=view.pixel + np.array([pixels, 0, 0, 0]))
    return np.roll(np.asarray(view), pixels, axis=1)


def knocked(kind: str, pixels: int = 7, views: int = 4) -> list[ViewEvidence]:
    return [aside(view, pixels) if k == KNOCKED else view for k, view in enumerate(shown(kind, views=views))]


class Watch:
    """Knocked views beside the tracks of people who stand."""

    def __init__(self, kind: str, views: int = 4) -> None:
        rig = replace(room(), cameras=room().cameras[:views])
        self.detector = Detector(rig, [kind] * views, FEW_HEIGHTS, BODY)
        self.found = KnockedViews(views, BODY, RATE, ErrorRateConfig())

    def compare(self, seen: Sequence[ViewEvidence], frames: int, tracks: Floats = STANDING) -> list[bool]:
        """Whether each view is knocked after some frames."""
        for _ in range(frames):
            self.found.compare(expecting(*tracks), self.detector.views, self.detector.observe(seen))
        return [bool(view) for view in self.found.knocked]


@given(st.integers(0, 2**32 - 1))
def test_found_is_the_foreground_inside_shifted_outlines(seed: int) -> None:
    rng = np.random.default_rng(seed)
    foreground, first = rng.random((9, 11)) < 0.5, rng.integers(0, 5, 3)
    left = rng.integers(0, 8, (3, 4))
    spans = np.stack([left, left + rng.integers(0, 4, left.shape)], -1).astype(np.int16)
    shifts, found, pixels = rng.integers(-6, 7, (5, 2)), np.empty((5, 3), np.int64), np.empty(3, np.int64)
    _fill_found(first, spans, foreground, shifts, found, pixels)
    outlines = np.zeros((3, 29, 31), bool)
    for j, row, (start, stop) in ((j, row, spans[j, row]) for j in range(3) for row in range(4)):
        outlines[j, 10 + first[j] + row, 10 + start : 10 + stop] = True
    padded = np.pad(foreground, 10)
    expected = [[(np.roll(own, shift, (0, 1)) & padded).sum() for own in outlines] for shift in shifts]
    assert found.tolist() == expected
    assert pixels.tolist() == outlines.sum((1, 2)).tolist()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("pixels", [7, -7, 14])
def test_a_view_is_knocked_from_the_first_frame_until_it_is_back(kind: str, pixels: int) -> None:
    watch = Watch(kind)
    assert watch.compare(shown(kind), 12) == [False] * 4
    assert watch.compare(knocked(kind, pixels), 1) == [k == KNOCKED for k in range(4)]
    assert watch.compare(knocked(kind, pixels), 10) == [k == KNOCKED for k in range(4)]
    assert watch.compare(shown(kind), 5) == [False] * 4


@pytest.mark.parametrize("kind", KINDS)
def test_tracks_that_err_in_all_views_knock_none(kind: str) -> None:
    watch, off = Watch(kind), STANDING + np.array([0.3, 0.2, 0.0])
    watch.compare(shown(kind), 12)
    assert watch.compare(shown(kind), 3, off) == [False] * 4


def test_a_view_that_shows_nothing_is_not_knocked() -> None:
    watch, seen = Watch("pixels"), shown("pixels")
    watch.compare(seen, 12)
    seen[KNOCKED] = np.zeros_like(np.asarray(seen[KNOCKED]))
    assert watch.compare(seen, 3) == [False] * 4


def test_a_view_that_stands_beside_from_the_start_is_not_knocked() -> None:
    assert Watch("pixels").compare(knocked("pixels"), 30) == [False] * 4


def test_one_person_alone_knocks_no_view() -> None:
    watch, one = Watch("pixels"), STANDING[:1]
    watch.compare(shown("pixels", one), 30, one)
    seen = shown("pixels", one)
    seen[KNOCKED] = aside(seen[KNOCKED], 7)
    assert watch.compare(seen, 3, one) == [False] * 4


def test_of_two_views_none_is_knocked() -> None:
    watch = Watch("pixels", views=2)
    seen = shown("pixels", views=2)
    watch.compare(seen, 12)
    assert watch.compare([seen[0], aside(seen[1], 7)], 3) == [False] * 2


def delivered(kind: str, frame: int, push: int) -> list[Observation]:
    """What cameras deliver of people who sway, while one of them is pushed by so many pixels."""
    standing = np.asarray(STANDING + np.array([0.04, 0.02, 0.0]) * np.sin(0.3 * frame))
    seen = [aside(view, push if k == KNOCKED else 0) for k, view in enumerate(shown(kind, standing, 3))]
    return [view if isinstance(view, Boxes) else as_mask(np.asarray(view)) for view in seen]


def as_mask(likelihood: Floats) -> Bytes:
    return np.asarray(255 * (likelihood > 0.5), np.uint8)


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_says_when_one_of_three_views_is_knocked(kind: str) -> None:
    rig = replace(room(), frame_rate=RATE, cameras=room().cameras[:3])
    tracker, results = Tracker(rig), []
    for frame in range(40):
        results += tracker.add(delivered(kind, frame, 7 if 15 <= frame < 30 else 0))
    results += tracker.finish()
    events = np.concatenate([result.events for result in results])
    events = events[events["kind"] == b"blind"]
    assert [rig.cameras[KNOCKED].name.encode() in reason for reason in events["reason"]] == [True, True]
    assert events["frame"][0] == 15
    assert 30 < events["frame"][1] < 36
    assert b"as after a push: excluded" in events["reason"][0]
    tracks = tracker.tracks(results)
    assert len(tracks.summary()) == len(STANDING)
    rows = tracks.trajectory
    away = np.hypot(rows["x"][:, None] - STANDING[:, 0], rows["y"][:, None] - STANDING[:, 1]).min(1)
    assert away.max() < 0.2


@pytest.mark.parametrize("kind", KINDS)
def test_how_far_beside_a_knocked_view_sees_people_is_measured(kind: str) -> None:
    apart = people((-1.0, 1.0, 1.7), (0.0, 0.0, 1.75), (1.0, -1.0, 1.65))
    detector = Watch(kind).detector
    learned, standing, seen = detector.new_estimates(), expecting(*apart), shown(kind, apart)
    for _ in range(15):
        before = detector.explain_next(learned, 0, seen, standing).residual
    seen[KNOCKED] = aside(seen[KNOCKED], 6)
    after = detector.explain_next(learned, 0, seen, standing).residual
    assert learned.failures.excluded.tolist() == [k == KNOCKED for k in range(4)]
    assert abs(before[KNOCKED]) < 0.1 and 0.2 < after[KNOCKED] < 0.6
