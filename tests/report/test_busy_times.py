"""Hours and busiest minutes are those of a count by hand."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Rows
from stseg.records.tables import TRAJECTORY
from stseg.reporting.run_statistics import Span, busiest_minutes, people_by_hour


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
