"""Statistics of a run: people by the minute and the hour, shares of the ground."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import Rows
from stseg.records.tables import TRAJECTORY
from stseg.reporting.run_statistics import Span, busiest_minutes, ground_by_views, people_by_hour, people_per_minute


def stays(*tracks: tuple[int, int]) -> Rows:
    """A track from each first frame to its stop."""
    rows = np.zeros(sum(stop - first for first, stop in tracks), TRAJECTORY)
    rows["id"] = np.repeat(np.arange(1, len(tracks) + 1), [stop - first for first, stop in tracks])
    rows["frame"] = np.concatenate([np.arange(*one) for one in tracks])
    return rows


def test_people_by_the_hour() -> None:
    span = Span(100, 100 + 5400, 1.0)
    first, second = people_by_hour(span, stays((100, 1900), (1000, 4600)))
    assert (first.first, first.stop, first.most, first.come) == (100, 3700, 2, 2)
    assert first.mean == (1800 + 2700) / 3600
    assert (second.first, second.stop, second.most, second.come, second.mean) == (3700, 5500, 1, 0, 0.5)


def test_the_busiest_minutes_are_in_order_of_time() -> None:
    span = Span(0, 600, 1.0)
    found = busiest_minutes(span, stays((300, 360), (300, 360), (60, 120), (480, 500)))
    assert [(one.first, one.mean, one.come) for one in found] == [(60, 1.0, 1), (300, 2.0, 2), (480, 1 / 3, 1)]
    assert busiest_minutes(span, stays((0, 0))) == []


def test_each_minute_has_its_own_mean() -> None:
    frames = np.arange(30, 30 + 90)  # a minute and a half, one frame a second
    rows = np.zeros(60 + 90, TRAJECTORY)
    rows["frame"] = np.concatenate([np.arange(30, 90), frames])
    np.testing.assert_allclose(people_per_minute(frames, rows, 1.0), [2, 1])
    assert people_per_minute(frames[:0], rows[:0], 1.0).shape == (0,)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 199), max_size=60), st.floats(0.2, 3))
def test_minutes_add_up_to_all_people(drawn: list[int], frame_rate: float) -> None:
    frames, rows = np.arange(200), np.zeros(len(drawn), TRAJECTORY)
    rows["frame"] = drawn
    length = max(1, round(60 * frame_rate))
    minutes = people_per_minute(frames, rows, frame_rate)
    lengths = np.diff([*range(0, 200, length), 200])
    np.testing.assert_allclose(minutes @ lengths, len(drawn))


def test_shares_of_the_ground_that_counts() -> None:
    views = np.zeros((2, 2, 3), np.uint8)
    views[1, 0] = 2
    views[0, 1, 0] = 1
    inside = np.array([[True, True, False], [True, True, False]])
    np.testing.assert_allclose(ground_by_views(views, inside, 2), [0.25, 0.25, 0.5])
