"""Charts of people and tracks over time agree with the tables."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import Rows
from stseg.records.tables import TRACK, TRAJECTORY
from stseg.reporting.charts import clock_time, people_chart, track_chart
from stseg.reporting.run_statistics import Span, doubtful_stretches, mean_certainty


def trajectory_of(*rows: tuple[int, int, float, float]) -> Rows:
    """Rows of frame, id, x, y."""
    table = np.zeros(len(rows), TRAJECTORY)
    for name, column in zip(("frame", "id", "x", "y"), zip(*rows, strict=True), strict=False):
        table[name] = column
    table["height"] = 1.7
    return table


def steps(svg: str, name: str) -> list[tuple[float, float]]:
    """Heights and ends of a chart's steps, pixels."""
    (path,) = re.findall(rf'<path class="{name}" d="([^"]*)"', svg)
    return [(float(v), float(u)) for v, u in re.findall(r"V([\d.]+) H([\d.]+)", path)]


def test_the_chart_counts_people() -> None:
    table = trajectory_of((10, 1, 0, 0), (11, 1, 0, 0), (11, 2, 0, 0))
    found = steps(people_chart(Span(10, 13, 5.0), table, None), "line")
    (one, two, none) = (v for v, _ in found)
    assert two < one < none
    assert none - one == pytest.approx(one - two, abs=0.2)


def test_the_chart_of_a_long_recording_stays_small() -> None:
    table = np.zeros(20000, TRAJECTORY)
    table["frame"] = np.arange(20000)
    assert len(steps(people_chart(Span(0, 20000, 25.0), table, None), "line")) <= 900


def test_sparse_truth_holds_until_the_next_frame_that_it_knows() -> None:
    truth = trajectory_of((0, 1, 0, 0), (3, 1, 0, 0), (3, 2, 0, 0))
    heights = [v for v, _ in steps(people_chart(Span(0, 6, 5.0), trajectory_of(), truth), "truth")]
    assert heights[0] == heights[1] == heights[2] > heights[3] == heights[4] == heights[5]


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 900), st.integers(0, 90)), max_size=40))
def test_bars_of_tracks_never_overlap(spans: list[tuple[int, int]]) -> None:
    tracks = np.zeros(len(spans), TRACK)
    for k, (first, length) in enumerate(spans):
        tracks["id"][k], tracks["first"][k], tracks["last"][k] = k + 1, first, first + length
    svg = track_chart(Span(0, 1000, 5.0), tracks, [])
    bars = [tuple(map(float, bar)) for bar in re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"', svg)]
    assert len(bars) == len(spans)
    for k, (u, v, width) in enumerate(bars):
        for other_u, other_v, other_width in bars[:k]:
            assert v != other_v or u + width <= other_u or other_u + other_width <= u


def test_doubtful_points_are_stretches_and_pale_in_the_bar() -> None:
    rows = trajectory_of(*((frame, track, 0, 0) for track in (1, 2) for frame in range(10)), (30, 2, 0, 0))
    rows["score"] = 8.0
    rows["score"][[3, 4, 7, 12, 20]] = 0.0
    found = doubtful_stretches(rows[::-1])
    assert [(one.track, one.first, one.last) for one in found] == [(1, 3, 4), (1, 7, 7), (2, 2, 2), (2, 30, 30)]
    assert [one.certainty for one in found] == pytest.approx([0.5] * 4)
    tracks = np.zeros(3, TRACK)
    tracks["id"], tracks["last"] = (1, 2, 3), (9, 30, 5)
    np.testing.assert_allclose(mean_certainty(rows, tracks), [0.85, 1 - 1 / 11, np.nan], atol=1e-3)
    svg = track_chart(Span(0, 40, 5.0), tracks, found)
    assert svg.count('class="pale"') == 4
    assert "track 1, frames 3 to 4: 50 % certain" in svg


def test_clock_times() -> None:
    assert [clock_time(second) for second in (0, 12.4, 75, 7385)] == ["0 s", "12.4 s", "1:15", "2:03:05"]
