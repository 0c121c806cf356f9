"""Frames between key frames: when the predicted tracks alone are the answer, and that they are a good one."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from checks import cases
from scenes import CONFIG, FEW_HEIGHTS, detector_of, evidence_of, expecting, people, room, standing_at, walkers

from stseg.arrays import Floats, ViewEvidence
from stseg.detection.detector import Detector
from stseg.detection.key_frames import key_frame_interval
from stseg.records.people import Explanation
from stseg.records.predicted_tracks import PredictedTracks
from stseg.tracking.filter.track_filter import TrackFilter

KINDS = ("pixels", "boxes")
RATE = 20.0
KEY, BETWEEN = 20, 21
HERE = ((-0.83, 0.31, 1.7), (0.9, -0.62, 1.75))


@cache
def detector(kind: str) -> Detector:
    return detector_of(replace(room(), frame_rate=RATE), kind)


def show(kind: str, standing: Floats) -> list[ViewEvidence]:
    return evidence_of(kind, room().cameras, standing)


def explained(kind: str, frame: int, standing: Floats, predicted: PredictedTracks) -> Explanation:
    learned = detector(kind).new_estimates()
    learned.frames = int(RATE)
    return detector(kind).explain_next(learned, frame, show(kind, standing), predicted)


def is_searched(explanation: Explanation) -> bool:
    """Residuals are measured by the whole search alone."""
    return bool(np.isfinite(explanation.residual).any())


@cases()
def test_no_more_time_passes_between_key_frames_than_is_asked(rate: float, longest: float, frames: int) -> None:
    config = replace(FEW_HEIGHTS, key_frame_interval=longest)
    assert key_frame_interval(rate, config, False) == frames
    assert key_frame_interval(rate, config, True) == min(frames, max(int(rate / 5), 1))


@pytest.mark.parametrize("kind", KINDS)
def test_known_people_are_followed_to_where_a_search_finds_them(kind: str) -> None:
    standing = people(*HERE)
    predicted = expecting(*(standing + np.array([0.04, -0.03, 0.0])))
    between, key = (explained(kind, frame, standing, predicted) for frame in (BETWEEN, KEY))
    assert is_searched(key) and not is_searched(between)
    for explanation in (between, key):
        who = explanation.people.track_index
        assert sorted(who.tolist()) == [0, 1]
        np.testing.assert_allclose(explanation.people.ground, standing[who, :2], atol=0.04)
        np.testing.assert_allclose(explanation.people.height, standing[who, 2], atol=0.06)


@pytest.mark.parametrize("kind", KINDS)
@cases()
def test_the_whole_frame_is_searched_where_something_is_open(
    kind: str, standing: Sequence[Sequence[float]], predicted: Sequence[Sequence[float]]
) -> None:
    views, expected = people(*standing), expecting(*predicted)
    by_search = detector(kind).explain(show(kind, views), expected)
    answer = explained(kind, BETWEEN, views, expected)
    np.testing.assert_array_equal(answer.people.ground, by_search.people.ground)


@pytest.mark.parametrize("kind", KINDS)
@cases()
def test_ground_is_searched_beside_settled_people(kind: str, arrives: Sequence[float], step: float) -> None:
    expected = expecting(HERE[0], (-1.2, 1.3), (-1.3, -0.9), (HERE[1][0] + step, *HERE[1][1:]))
    standing = people(HERE[0], (-1.2, 1.3), (-1.3, -0.9), HERE[1], arrives)
    answer = explained(kind, BETWEEN, standing, expected)
    who = answer.people.track_index
    assert sorted(who.tolist()) == [-1, 0, 1, 2, 3] and not is_searched(answer)
    np.testing.assert_allclose(answer.people.ground, standing[who, :2], atol=0.1)
    np.testing.assert_allclose(answer.people.height[who < 0], standing[-1, 2], atol=0.06)


@pytest.mark.parametrize("kind", KINDS)
def test_who_lingers_outside_or_is_gone_needs_no_search(kind: str) -> None:
    all_three = (*HERE, (room().grid.x[1] + 0.05, 0.4, 1.75))
    answer = explained(kind, BETWEEN, people(*all_three), expecting(*all_three))
    assert not is_searched(answer)
    who = answer.people.track_index
    assert sorted(who.tolist()) == [0, 1, 2]
    np.testing.assert_allclose(answer.people.ground, people(*all_three)[who, :2], atol=0.04)
    answer = explained(kind, BETWEEN, people(*HERE), expecting(*HERE, (1.2, 1.2)))
    assert sorted(answer.people.track_index.tolist()) == [0, 1] and not is_searched(answer)


def test_an_empty_room_stays_empty() -> None:
    answer = explained("pixels", BETWEEN, people(), expecting())
    assert len(answer.people) == 0 and all((owner < 0).all() for owner in answer.pixel_assignment)


@pytest.mark.parametrize("kind", KINDS)
def test_walkers_are_followed_as_by_searches(kind: str) -> None:
    truth, detector_of_kind, first = walkers(24), detector(kind), {"pixels": 10, "boxes": 4}[kind]
    follow, learned = TrackFilter(RATE, CONFIG), detector_of_kind.new_estimates()
    names, searched = set[int](), 0
    for frame in range(24):
        standing = standing_at(truth, frame)
        answer = detector_of_kind.explain_next(learned, frame, show(kind, standing), follow.predict(frame))
        names |= set(follow.update(frame, answer.people, answer.ghosts).tolist())
        searched += is_searched(answer)
        assert searched == frame + 1 or frame >= first
        away = np.hypot(*(answer.people.ground[:, None] - standing[:, :2]).transpose(2, 0, 1))
        assert away.shape == (3, 3) and away.min(0).max() < 0.12
    assert len(names) == 3 and 3 <= searched < 16
