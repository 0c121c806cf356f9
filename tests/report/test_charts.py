"""Charts, statistics and maps of a run agree with its tables."""

import re
from dataclasses import replace

import numpy as np
import pytest
from checks import drawn
from hypothesis import strategies as st
from run_files import table_of, trajectory_of

from stseg.arrays import Rows
from stseg.geometry import Grid, Rig
from stseg.records.point_probability import point_probability
from stseg.records.tables import TRACK, TRAJECTORY, Tracks
from stseg.reporting import run_statistics
from stseg.reporting.charts import clock_time, people_chart, track_chart
from stseg.reporting.pictures.maps import Bins, blind_map, density, dwell, dwell_places, heat_map, warm_colours
from stseg.reporting.pictures.plan_map import PlanMap


def steps(svg: str, name: str) -> list[tuple[float, float]]:
    """Heights and ends of a chart's steps, pixels."""
    (path,) = re.findall(rf'<path class="{name}" d="([^"]*)"', svg)
    return [(float(v), float(u)) for v, u in re.findall(r"V([\d.]+) H([\d.]+)", path)]


def test_the_chart_counts_people_and_sparse_truth_in_brief() -> None:
    table = trajectory_of((10, 1, 0, 0), (11, 1, 0, 0), (11, 2, 0, 0))
    found = steps(people_chart(run_statistics.Span(10, 13, 5.0), table, None), "line")
    (one, two, none) = (v for v, _ in found)
    assert two < one < none and none - one == pytest.approx(one - two, abs=0.2)
    table = table_of(TRAJECTORY, frame=np.arange(20000))
    assert len(steps(people_chart(run_statistics.Span(0, 20000, 25.0), table, None), "line")) <= 900
    truth = trajectory_of((0, 1, 0, 0), (3, 1, 0, 0), (3, 2, 0, 0))
    heights = [v for v, _ in steps(people_chart(run_statistics.Span(0, 6, 5.0), trajectory_of(), truth), "truth")]
    assert heights[0] == heights[1] == heights[2] > heights[3] == heights[4] == heights[5]


def test_bins_are_round_and_never_finer_than_cells() -> None:
    assert Bins.of(GRID).side == 0.5 and Bins.of(Grid((0, 5), (0, 5), 0.1)).side == 0.25
    assert Bins.of(Grid((0, 30), (0, 5), 0.1)).side == 1.0


@drawn(30, st.lists(st.tuples(st.integers(0, 900), st.integers(0, 90)), max_size=40))
def test_bars_of_tracks_never_overlap(spans: list[tuple[int, int]]) -> None:
    first, length = np.reshape(spans, (-1, 2)).T
    tracks = table_of(TRACK, id=np.arange(len(spans)) + 1, first=first, last=first + length)
    svg = track_chart(run_statistics.Span(0, 1000, 5.0), tracks, [])
    bars = [tuple(map(float, bar)) for bar in re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"', svg)]
    assert len(bars) == len(spans)
    for k, (u, v, width) in enumerate(bars):
        for other_u, other_v, other_width in bars[:k]:
            assert v != other_v or u + width <= other_u or other_u + other_width <= u


def test_doubtful_points_are_stretches_and_pale_in_the_bar() -> None:
    rows = trajectory_of(*((frame, track, 0, 0) for track in (1, 2) for frame in range(10)), (30, 2, 0, 0))
    rows["score"], rows["views"] = 8.0, 9
    rows["score"][[3, 4, 7, 12, 20]] = 0.0
    probability = point_probability(rows, ["masks"])
    found = run_statistics.doubtful_stretches(rows[::-1], probability[::-1])
    assert [(one.track, one.first, one.last) for one in found] == [(1, 3, 4), (1, 7, 7), (2, 2, 2), (2, 30, 30)]
    assert [one.certainty for one in found] == pytest.approx([0.5] * 4, rel=2e-3)
    tracks = table_of(TRACK, id=(1, 2, 3), last=(9, 30, 5))
    np.testing.assert_allclose(
        run_statistics.mean_certainty(rows, probability, tracks),
        0.999 * np.array([0.85, 1 - 1 / 11, np.nan]),
        atol=1e-3,
    )
    svg = track_chart(run_statistics.Span(0, 40, 5.0), tracks, found)
    assert svg.count('class="pale"') == 4 and "track 1, frames 3 to 4: 50 % certain" in svg


def test_few_views_ends_and_absence_make_points_less_certain() -> None:
    rows = trajectory_of(*((frame, 1, 0, 0) for frame in range(8)))
    rows["score"], rows["views"] = 50.0, np.arange(8)
    certain = point_probability(rows, ["boxes", "video"])
    by_boxes = point_probability(rows, ["boxes"])
    assert by_boxes[2] > certain[2] and (by_boxes >= certain).all()
    assert (np.diff(certain) >= 0).all()
    assert certain[1] < 0.6 < 0.9 < certain[2] < 0.98 < 0.99 < certain[7] < 1
    walks = [(frame, track, x, 0.0) for track, x in ((1, 3.0), (2, 8.0)) for frame in range(40)]
    late = [(frame, 3, 4.0, 0.0) for frame in range(20, 40)]  # begins inside, a metre from the first
    at_border = [(frame, 4, 9.8, 0.0) for frame in range(20, 40)]
    away = [(frame, 5, 5.0, 4.0) for frame in (*range(10), *range(30, 40))]
    rows = trajectory_of(*walks, *late, *at_border, *away)
    tracks = Tracks(rows).summary()
    chances = run_statistics.exchange_chances(rows, tracks, 10.0, np.array([[0.0, -5.0], [10.0, 5.0]]))
    assert chances[1] == chances[2] == chances[3] < chances[0] < chances[4] < 1
    assert run_statistics.exchange_chances(rows[:0], tracks[:0], 10.0, np.zeros((2, 2))).shape == (0,)


def stays(*tracks: tuple[int, int]) -> Rows:
    """A track from each first frame to its stop."""
    return trajectory_of(*((frame, k, 0, 0) for k, own in enumerate(tracks, 1) for frame in range(*own)))


def test_people_by_the_hour_the_minutes_and_clock_times() -> None:
    span = run_statistics.Span(100, 100 + 5400, 1.0)
    first, second = run_statistics.people_by_hour(span, stays((100, 1900), (1000, 4600)))
    assert (first.first, first.stop, first.most, first.come) == (100, 3700, 2, 2)
    assert first.mean == (1800 + 2700) / 3600
    assert (second.first, second.stop, second.most, second.come, second.mean) == (3700, 5500, 1, 0, 0.5)
    span = run_statistics.Span(0, 600, 1.0)
    found = run_statistics.busiest_minutes(span, stays((300, 360), (300, 360), (60, 120), (480, 500)))
    assert [(one.first, one.mean, one.come) for one in found] == [(60, 1.0, 1), (300, 2.0, 2), (480, 1 / 3, 1)]
    assert run_statistics.busiest_minutes(span, stays((0, 0))) == []
    frames = np.arange(30, 30 + 90)  # a minute and a half, one frame a second
    rows = table_of(TRAJECTORY, frame=np.concatenate([np.arange(30, 90), frames]))
    np.testing.assert_allclose(run_statistics.people_per_minute(frames, rows, 1.0), [2, 1])
    assert run_statistics.people_per_minute(frames[:0], rows[:0], 1.0).shape == (0,)
    assert [clock_time(second) for second in (0, 12.4, 75, 7385)] == ["0 s", "12.4 s", "1:15", "2:03:05"]


@drawn(25, st.lists(st.integers(0, 199), max_size=60), st.floats(0.2, 3))
def test_minutes_add_up_to_all_people(drawn: list[int], frame_rate: float) -> None:
    frames, rows = np.arange(200), table_of(TRAJECTORY, frame=drawn)
    length = max(1, round(60 * frame_rate))
    minutes = run_statistics.people_per_minute(frames, rows, frame_rate)
    lengths = np.diff([*range(0, 200, length), 200])
    np.testing.assert_allclose(minutes @ lengths, len(drawn))


def test_shares_density_and_stays_on_the_ground() -> None:
    views = np.zeros((2, 2, 3), np.uint8)
    views[1, 0] = 2
    views[0, 1, 0] = 1
    inside = np.array([[True, True, False], [True, True, False]])
    np.testing.assert_allclose(run_statistics.ground_by_views(views, inside, 2), [0.25, 0.25, 0.5])
    found = density(BINS, trajectory_of((0, 1, 0.5, -0.5), (1, 1, 0.6, -0.4), (1, 2, 3.9, 1.9), (1, 3, 9, 9)), 2)
    assert found.shape == (3, 4) and (found[0, 0], found[2, 3], found.sum()) == (1, 0.5, 1.5)
    assert density(Bins(BINS.x, BINS.y, 0.5), trajectory_of((0, 1, 0.2, -0.9)), 1)[0, 0] == 4
    home, away = (0.5, -0.5), (2.5, -0.5)
    walk = [home, home, home, home, away, home, home, away]
    found = dwell(BINS, trajectory_of(*((frame, 1, *place) for frame, place in enumerate(walk))), 2.0)
    assert (found[0, 0], found[0, 2]) == (6 / 2 / 2.0, 2 / 2 / 2.0)  # frames a stay at two frames a second
    two = trajectory_of((0, 1, *home), (1, 1, *home), (0, 2, *home), (1, 2, *home))
    assert dwell(BINS, two, 2.0)[0, 0] == 1 and not dwell(BINS, trajectory_of(), 2.0).any()


GRID = Grid((0.0, 4.0), (-1.0, 2.0), 0.5, 1.8, 3)
RIG = Rig("hall", 2.0, GRID, ())
BINS = Bins((0.0, 4.0), (-1.0, 2.0), 1.0)


@drawn(30, st.lists(st.tuples(st.floats(-1, 5), st.floats(-2, 3)), max_size=50))
def test_every_row_on_the_ground_is_counted_once(places: list[tuple[float, float]]) -> None:
    rows = trajectory_of(*((k, 1, x, y) for k, (x, y) in enumerate(places)))
    inside = (rows["x"] >= 0) & (rows["x"] < 4) & (rows["y"] >= -1) & (rows["y"] < 2)
    assert BINS.count(BINS.index(rows)).sum() == inside.sum()


def test_haunts_are_where_most_time_is_spent_if_anywhere() -> None:
    rng = np.random.default_rng(3)
    waiting = rng.normal((1.0, 0.0), 0.1, (300, 2))
    talking = rng.normal((3.0, 1.0), 0.1, (100, 2))
    passing = rng.uniform((0, -1), (4, 2), (20, 2))
    places = np.concatenate([waiting, talking, passing])
    rows = trajectory_of(*((k, 1, x, y) for k, (x, y) in enumerate(places.tolist())))
    found = dwell_places(rows, Bins(BINS.x, BINS.y, 0.25))
    assert len(found) == 2
    np.testing.assert_allclose([(place.x, place.y) for place in found], [(1, 0), (3, 1)], atol=0.15)
    np.testing.assert_allclose([place.share for place in found], [300 / 420, 100 / 420], atol=0.04)
    even = np.stack(np.meshgrid(np.arange(0.05, 20, 0.25), np.arange(0.05, 20, 0.25)), -1).reshape(-1, 2)
    rows = trajectory_of(*((k, 1, x, y) for k, (x, y) in enumerate(even.tolist())))
    assert dwell_places(rows, Bins((0.0, 20.0), (0.0, 20.0), 0.5)) == []
    assert dwell_places(rows[:0], BINS) == []


def test_a_heat_map_is_dark_where_much_is_and_red_where_blind() -> None:
    values = np.zeros(BINS.shape)
    values[2, 3], values[0, 0] = 8.0, 2.0
    picture = heat_map(RIG, BINS, values, "title", "units").astype(int)
    plan = PlanMap.fit(GRID, np.zeros((0, 2)), 900, 900)
    tones = []
    for place in ((3.3, 1.3), (0.3, -0.7), (0.3, 1.3)):
        u, v = np.rint(plan.pixel(np.array(place))).astype(int)
        tones.append(picture[v, u].sum())
    assert tones[0] < tones[1] < tones[2]
    assert heat_map(RIG, BINS, np.zeros(BINS.shape), "", "").shape == picture.shape
    brightness = warm_colours(np.linspace(0, 1, 9), 1.0).astype(int).sum(axis=1)
    assert (np.diff(brightness) < 0).all()
    views = np.full(GRID.shape, 1, np.uint8)
    views[:, 0, 0] = 0  # least x, least y
    picture = blind_map(RIG, views)
    u, v = np.rint(plan.pixel(np.array([0.25, -0.65]))).astype(int)
    blue, green, red = picture[v, u].tolist()
    assert red > 150 > max(blue, green)
    part = replace(RIG, grid=replace(GRID, polygon=np.array([(1.0, -1.0), (4.0, -1.0), (4.0, 2.0), (1.0, 2.0)])))
    assert blind_map(part, views)[v, u].min() > 200  # beside the polygon nobody is sought
