"""Views that fail, freeze or are knocked: when they are left out, and when they count again."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from checks import cases, drawn, examples, in_ci
from hypothesis import strategies as st
from scenes import BODY, detector_of, evidence_of, expecting, likelihoods, looking, no_boxes, people, rig_of, room

from stseg import Tracker
from stseg.arrays import Boxes, Floats, Observation, Rows, ViewEvidence
from stseg.config import ErrorRateConfig
from stseg.detection.detector import Detector
from stseg.noise.estimates import Estimates
from stseg.records.tables import Tracks
from stseg.view_health.blind_views import FrozenViews
from stseg.view_health.knocked_views import KnockedViews, found_pixels
from stseg.view_health.view_failures import informedness

STANDING = people((-0.9, 0.4, 1.7), (0.8, -0.6, 1.75), (0.7, 0.9, 1.65))
RATE = 10.0
FAILED = 2
KINDS = ("pixels", "boxes")


@drawn(100, st.integers(0, 2**32 - 1), st.integers(0, 4))
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
    asked = detector_of(rig, kind)
    return asked, asked.new_estimates()


def shown(kind: str, standing: Floats = STANDING, views: int = 4) -> list[ViewEvidence]:
    return evidence_of(kind, room().cameras[:views], standing)


def explained(asked: Detector, learned: Estimates, seen: Sequence[ViewEvidence], frames: int) -> None:
    for _ in range(frames):
        asked.explain_next(learned, 0, seen, None)


def failed(kind: str, failure: str, seen: Sequence[ViewEvidence]) -> list[ViewEvidence]:
    bad: ViewEvidence = no_boxes()
    if kind == "pixels":
        level = {"black": np.zeros, "white": np.ones}.get(failure, np.random.default_rng(3).random)
        bad = np.asarray(level(np.asarray(seen[FAILED]).shape), np.float32)
    return [bad if k == FAILED else own for k, own in enumerate(seen)]


@cases()
def test_a_view_that_fails_is_left_out_and_counts_again(kind: str, failure: str, frames: int) -> None:
    """After a short failure the same people come back, after a long one the scene is empty."""
    (asked, learned), seen = session(kind), shown(kind)
    explained(asked, learned, seen, 10)
    assert not learned.failures.failing.any()
    explained(asked, learned, failed(kind, failure, seen), frames)
    assert learned.failures.failing.tolist() == [k == FAILED for k in range(4)]
    assert [view is None for view in learned.failures.kept(seen)] == learned.failures.failing.tolist()
    explained(asked, learned, seen if frames == 5 else shown(kind, people()), 2 * min(frames, 10))
    assert not learned.failures.failing.any()


@pytest.mark.parametrize(("others", "failing"), [(4, True), *in_ci((3, False))])
def test_a_view_that_never_showed_people_fails_beside_four(others: int, failing: bool) -> None:
    corner, *more = room().cameras
    rig = rig_of([corner, *more, looking("beside", (0.0, -3.6, 2.6))][: others + 1])
    asked = detector_of(replace(rig, frame_rate=RATE), "pixels")
    learned, seen = asked.new_estimates(), list(likelihoods(rig.cameras, STANDING))
    half = [np.where(np.arange(view.shape[1]) % 2, view, 0.0).astype(np.float32) for view in map(np.asarray, seen)]
    explained(asked, learned, [half[0], *seen[1:]], 50)
    assert learned.failures.failing.tolist() == [failing] + [False] * others
    explained(asked, learned, seen, 10)
    assert not learned.failures.failing.any()


def test_of_two_views_neither_fails_nor_one_that_never_worked() -> None:
    (asked, learned), seen = session("pixels"), shown("pixels")
    explained(asked, learned, failed("pixels", "black", seen), 40)
    assert not learned.failures.failing.any()
    (asked, learned), seen = session("pixels", 2), shown("pixels", views=2)
    explained(asked, learned, seen, 10)
    explained(asked, learned, [seen[0], np.zeros_like(np.asarray(seen[1]))], 20)
    assert not learned.failures.failing.any()


@pytest.mark.parametrize("missed", [0.25, *in_ci(0.1)])
def test_a_detector_that_misses_boxes_excludes_no_view(missed: float) -> None:
    """Of few people one box more or less is a large share; a view that then shows nothing is still found out."""
    (asked, learned), rng, excluded = session("boxes"), np.random.default_rng(6), 0
    standing = STANDING[:2]
    seen = [view for view in shown("boxes", standing) if isinstance(view, Boxes)]
    for _ in range(examples(150)):
        explained(asked, learned, [view.of(rng.random(len(view)) >= missed) for view in seen], 1)
        excluded += int(learned.failures.failing.sum())
    assert excluded <= 0.01 * examples(150) * len(seen)
    explained(asked, learned, failed("boxes", "black", seen), 12)
    assert learned.failures.failing.tolist() == [k == FAILED for k in range(4)]


def swaying(kind: str, frame: int, views: int) -> list[ViewEvidence]:
    return shown(kind, STANDING + np.array([0.04, 0.02, 0.0]) * np.sin(0.3 * frame), views)


def run(frames: Sequence[Sequence[ViewEvidence]]) -> tuple[Rows, Tracks]:
    """Events of blind views, and the tracks, of what cameras deliver; likelihoods as masks."""
    tracker, results = Tracker(replace(room(), frame_rate=RATE, cameras=room().cameras[: len(frames[0])])), []
    for views in frames:
        masks = [one if isinstance(one, Boxes) else np.uint8(255) * (np.asarray(one) > 0.5) for one in views]
        results += tracker.add(masks)
    results += tracker.finish()
    events = np.concatenate([result.events for result in results])
    return events[events["kind"] == b"blind"], tracker.tracks(results)


KNOCKED = 2


def aside(view: ViewEvidence, pixels: int) -> ViewEvidence:
    if isinstance(view, Boxes):
        return replace(view, pixel=view.pixel + np.array([pixels, 0, 0, 0]))
    return np.roll(np.asarray(view), pixels, axis=1)


def knocked(kind: str, pixels: int = 7, views: int = 4) -> list[ViewEvidence]:
    return [aside(view, pixels) if k == KNOCKED else view for k, view in enumerate(shown(kind, views=views))]


class Watch:
    """Knocked views beside the tracks of people who stand."""

    def __init__(self, kind: str, views: int = 4) -> None:
        rig = replace(room(), cameras=room().cameras[:views])
        self.detector = detector_of(rig, kind)
        self.found = KnockedViews(views, BODY, RATE, ErrorRateConfig())

    def compare(self, seen: Sequence[ViewEvidence], frames: int, tracks: Floats = STANDING) -> list[bool]:
        """Whether each view is knocked after some frames."""
        for _ in range(frames):
            self.found.compare(expecting(*tracks), self.detector.views, self.detector.observe(seen))
        return [bool(view) for view in self.found.knocked]


@drawn(100, st.integers(0, 2**32 - 1))
def test_found_is_the_foreground_inside_shifted_outlines(seed: int) -> None:
    rng = np.random.default_rng(seed)
    foreground, first = rng.random((9, 11)) < 0.5, rng.integers(0, 5, 3)
    left = rng.integers(0, 8, (3, 4))
    spans = np.stack([left, left + rng.integers(0, 4, left.shape)], -1).astype(np.int16)
    shifts = rng.integers(-6, 7, (5, 2))
    found, pixels = found_pixels(first, spans, foreground, shifts)
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


@pytest.mark.parametrize(
    ("views", "standing", "level"), [(4, STANDING, 0), (4, STANDING[:1], 1), (2, STANDING, 1)],
    ids=["a view that shows nothing", "one person alone", "two views"],
)  # fmt: skip
def test_what_may_be_something_else_knocks_no_view(views: int, standing: Floats, level: int) -> None:
    watch, seen = Watch("pixels", views), shown("pixels", standing, views)
    watch.compare(seen, 30, standing)
    seen[-1] = level * np.asarray(aside(seen[-1], 7))
    assert watch.compare(seen, 3, standing) == [False] * views


@pytest.mark.parametrize("kind", ["pixels", *in_ci("boxes")])
@pytest.mark.parametrize(("views", "latest", "reason"), [(4, 19, b"excluded"), (3, 15, b"as after a push: excluded")])
def test_a_run_says_when_a_view_is_left_out(kind: str, views: int, latest: int, reason: bytes) -> None:
    """One of four views shows nobody for a while, or one of three is knocked."""
    frames = [swaying(kind, frame, views) for frame in range(45)]
    for seen in frames[15:30]:
        seen[KNOCKED] = aside(seen[KNOCKED], 7) if views == 3 else shown(kind, people())[KNOCKED]
    events, tracks = run(frames)
    assert [room().cameras[KNOCKED].name.encode() in said for said in events["reason"]] == [True, True]
    assert 15 <= events["frame"][0] <= latest and 30 < events["frame"][1] < 36
    assert reason in events["reason"][0]
    assert f"after {events['frame'][1] - events['frame'][0]} frames".encode() in events["reason"][1]
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
    if kind == "pixels":
        seen[KNOCKED] = np.zeros_like(seen[KNOCKED])  # black
        assert np.isnan(detector.explain_next(learned, 0, seen, standing).residual[KNOCKED])


FROZEN_KINDS = ("masks", "colour", "boxes")


def view(kind: str, number: int) -> Observation:
    """What a camera shows that shows something else for each number; nobody for 0."""
    if kind == "boxes":
        return Boxes(np.full((min(number, 1), 4), float(number)), np.ones(min(number, 1)))
    return np.full((4, 5, 3) if kind == "colour" else (4, 5), number, np.uint8)


def frozen_views(kind: str, numbers: list[list[int]], rate: float = 10.0) -> list[list[bool]]:
    """Which views are frozen in each frame."""
    frozen = FrozenViews(len(numbers[0]), rate)
    return [[one is None for one in frozen.without([view(kind, k) for k in row])] for row in numbers]


@pytest.mark.parametrize("kind", FROZEN_KINDS)
def test_a_view_is_frozen_after_half_a_second(kind: str) -> None:
    found = frozen_views(kind, [[1 + k, 7 if 3 <= k < 12 else 20 + k, 40 + k] for k in range(16)])
    assert [row[1] for row in found] == [8 <= k < 12 for k in range(16)]
    assert not any(row[0] or row[2] for row in found)


def test_what_is_no_frozen_view() -> None:
    """All stand still, or some of them; one shows nobody; frames fill gaps."""
    for kind in FROZEN_KINDS:
        assert not np.any(frozen_views(kind, [[1, 2, 3]] * 30, RATE))
        assert not np.any(frozen_views(kind, [[1 + k, 2, 3, 4] for k in range(30)], RATE))
    for kind in ("masks", "boxes"):
        assert not np.any(frozen_views(kind, [[1 + k, 0, 40 + k] for k in range(30)], RATE))
    for repeats, rate in ((2, 10.0), (5, 25.0), (3, 2.0)):
        assert not np.any(frozen_views("colour", [[1 + k, 2 + k // repeats, 9 + k] for k in range(60)], rate))


def test_views_back_or_beside_from_the_start_are_right() -> None:
    frozen = FrozenViews(2, 10.0)
    for k in range(20):
        own = None if k < 10 else view("masks", 5 + k)
        assert (frozen.without([view("masks", 1 + k), own])[1] is None) == (own is None)
    assert Watch("pixels").compare(knocked("pixels"), 30) == [False] * 4
