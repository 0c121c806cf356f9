"""Pictures say what the tables say: right place, right colour, right way up; the page holds nothing it should not."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
import run_files
import strategies
from hypothesis import given, settings
from hypothesis import strategies as st

from stseg.arrays import AnyArray, Boxes, Bytes, Rows
from stseg.commands.report import report
from stseg.errors import ConfigError, FormatError, OutputError, SourceError
from stseg.geometry import Camera, Grid, Rig
from stseg.io.recording.recording import CameraSource, Source
from stseg.io.runfile.runs import RunWriter, read_run
from stseg.records.tables import EVENT, TRACK, TRAJECTORY, Tracks
from stseg.reporting import marginal_picture, overlay, plan_view, spacetime_picture, volume_picture
from stseg.reporting.charts import clock_time, people_chart, track_chart
from stseg.reporting.figures import backdrop
from stseg.reporting.pictures.canvas import place_labels
from stseg.reporting.pictures.colours import NIGHT, PAPER, track_colour
from stseg.reporting.pictures.overlay import OverlayView, pillar_outline
from stseg.reporting.pictures.plan import plan_map
from stseg.reporting.pictures.slices import colours_of
from stseg.reporting.pictures.spacetime import Block
from stseg.reporting.run_statistics import Span, doubtful_stretches, mean_certainty
from stseg.tasks.report import write_pictures

GRID = Grid((0.0, 4.0), (-1.0, 2.0), 0.5, 1.8, 3)


def trajectory_of(*rows: tuple[int, int, float, float]) -> Rows:
    """Rows of frame, id, x, y."""
    table = np.zeros(len(rows), TRAJECTORY)
    for name, column in zip(("frame", "id", "x", "y"), zip(*rows, strict=True), strict=False):
        table[name] = column
    table["height"] = 1.7
    return table


def front_camera(size: tuple[int, int] = (320, 240)) -> Camera:
    """Three metres above y = -5, looking along y and 20 degrees down."""
    down = np.radians(20)
    rotation = np.array([[1, 0, 0], [0, -np.sin(down), -np.cos(down)], [0, np.cos(down), -np.sin(down)]])
    matrix = np.array([[250.0, 0, (size[0] - 1) / 2], [0, 250.0, (size[1] - 1) / 2], [0, 0, 1]])
    place = np.array([2.0, -5.0, 3.0])
    return Camera.from_projection("front", size, matrix @ np.column_stack([rotation, -rotation @ place]))


RIG = Rig("hall", 5.0, GRID, (front_camera(),))


def at(picture: Bytes, pixel: AnyArray) -> tuple[int, int, int]:
    """The colour at a pixel (u, v)."""
    u, v = np.rint(pixel).astype(int)
    blue, green, red = picture[v, u].tolist()
    return blue, green, red


def has(picture: Bytes, colour: tuple[int, int, int]) -> bool:
    return bool((picture == colour).all(axis=-1).any())


# Colours


def test_few_tracks_have_colours_that_nobody_mistakes() -> None:
    colours = np.array([track_colour(k) for k in range(1, 9)], float)
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=-1) + 1e3 * np.eye(8)
    assert apart.min() > 60
    assert all(np.linalg.norm(colours - ground, axis=1).min() > 100 for ground in (PAPER, NIGHT))


# The plan view


def test_the_plan_shows_a_track_at_its_places_in_its_colour() -> None:
    path = [(frame, 7, 0.5 + 0.25 * frame, 1.5 - 0.2 * frame) for frame in range(12)]
    picture = plan_view(RIG, trajectory_of(*path))
    plan = plan_map(RIG)
    assert picture.shape == (plan.size[1], plan.size[0], 3)
    for _, identity, x, y in path[:-1]:
        assert at(picture, plan.pixel(np.array([x, y]))) == track_colour(identity)


def test_in_the_plan_y_points_up_and_x_to_the_right() -> None:
    plan = plan_map(RIG)
    low, high = plan.pixel(np.array([[1.0, 0.0], [3.0, 1.0]]))
    assert high[0] > low[0] and high[1] < low[1]
    np.testing.assert_allclose(high - low, [2 * plan.scale, -plan.scale])
    picture = plan_view(RIG, trajectory_of((0, 1, 1.0, -0.5), (0, 2, 1.0, 1.5)))
    assert at(picture, plan.pixel(np.array([1.0, -0.5]))) == track_colour(1)
    assert at(picture, plan.pixel(np.array([1.0, 1.5]))) == track_colour(2)


def test_the_plan_shades_what_few_views_see_at_its_place() -> None:
    coverage = np.full(GRID.shape[1:], 3, np.uint8)
    coverage[0, -1] = 0  # least y, greatest x
    picture = plan_view(RIG, trajectory_of(), None, coverage)
    plan = plan_map(RIG)
    unseen, *seen = (at(picture, plan.pixel(np.array(place))) for place in ((3.8, -0.8), (3.8, 1.8), (0.3, -0.8)))
    assert all(max(unseen) < min(other) for other in seen)


def test_a_gap_of_a_track_is_no_solid_line() -> None:
    plan = plan_map(RIG)
    whole = [(frame, 1, 0.5 + 0.1 * frame, 0.3) for frame in range(30)]
    torn = [row for row in whole if not 10 <= row[0] < 20]
    between = plan.pixel(np.stack([np.linspace(1.55, 2.35, 60), np.full(60, 0.3)], -1))
    pictures = [plan_view(RIG, trajectory_of(*rows)) for rows in (whole, torn)]
    assert [sum(at(picture, pixel) == track_colour(1) for pixel in between) for picture in pictures] == [60, 0]


def test_truth_is_dashed_and_leaves_the_tracks_visible() -> None:
    truth = trajectory_of(*((frame, 9, 0.5 + 0.1 * frame, 1.0) for frame in range(30)))
    plain, both = (plan_view(RIG, trajectory_of((0, 1, 1.0, 0.0)), table) for table in (None, truth))
    line = np.rint(plan_map(RIG).pixel(np.stack([np.linspace(0.5, 3.4, 400), np.full(400, 1.0)], -1))).astype(int)
    dark = both[line[:, 1], line[:, 0]].max(axis=1) < 130
    assert 0.3 < dark.mean() < 0.8
    assert not (plain[line[:, 1], line[:, 0]].max(axis=1) < 130).any()


def test_sparse_truth_is_one_line_though_frames_are_missing() -> None:
    every = trajectory_of(*((frame, 1, 0.5 + 0.1 * frame, 1.0) for frame in range(20)))
    sparse = every.copy()
    sparse["frame"] *= 10
    pictures = [plan_view(RIG, trajectory_of(), truth) for truth in (every, sparse)]
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_many_tracks_are_drawn_thinner() -> None:
    def painted(count: int) -> float:
        rows = [(frame, k, 0.2 + 0.1 * frame, -0.9 + 2.8 * k / count) for k in range(count) for frame in range(35)]
        picture = plan_view(RIG, trajectory_of(*rows))
        plan = plan_map(RIG)
        column = picture[:, int(plan.pixel(np.array([1.75, 0.0]))[0])]
        return float((np.ptp(column.astype(int), axis=1) > 40).sum() / count)

    few, many = painted(8), painted(150)
    assert few >= 3 > 2 >= many > 0


def test_a_camera_that_is_far_away_does_not_shrink_the_plan() -> None:
    far = Rig("hall", 5.0, GRID, (replace_centre(front_camera(), (2.0, -500.0)),))
    alone = Rig("hall", 5.0, GRID, ())
    assert plan_map(far) == plan_map(alone)
    assert not np.array_equal(plan_view(far, trajectory_of()), plan_view(alone, trajectory_of()))


def replace_centre(camera: Camera, place: tuple[float, float]) -> Camera:
    rotation = camera.projection[:, :3]
    shifted = np.array([*place, camera.centre[2]])
    return Camera.from_projection(camera.name, camera.size, np.column_stack([rotation, -rotation @ shifted]))


def test_a_camera_that_looks_straight_down_has_a_place_but_no_wedge(tmp_path: Path) -> None:
    rig = run_files.small_recording(tmp_path).rig
    picture = plan_view(rig, trajectory_of(), width=900, height=900)
    place = plan_map(rig, 900, 900).pixel(rig.cameras[0].centre[:2])
    assert picture.shape[2] == 3 and np.isfinite(place).all()


@settings(max_examples=15, deadline=None)
@given(strategies.rigs())
def test_any_rig_has_a_plan(rig: Rig) -> None:
    middle = rig.grid.ground[rig.grid.inside()].mean(axis=0)
    picture = plan_view(rig, trajectory_of((0, 3, *middle.tolist())), width=700, height=600)
    plan = plan_map(rig, 700, 600)
    assert picture.shape == (plan.size[1], plan.size[0], 3)
    assert at(picture, plan.pixel(middle))[:2] != PAPER[:2]


# Labels


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 400), st.floats(0, 300)), max_size=12))
def test_labels_stay_on_the_canvas(points: list[tuple[float, float]]) -> None:
    centres = place_labels(np.array(points).reshape(-1, 2), [(30, 16)] * len(points), (0, 0, 400, 300))
    assert centres.shape == (len(points), 2)
    assert (centres >= (15, 8)).all() and (centres <= (385, 292)).all()


def test_labels_of_neighbours_do_not_cover_each_other() -> None:
    points = np.array([[200.0, 150.0], [206.0, 150.0], [200.0, 156.0]])
    centres = place_labels(points, [(30, 16)] * 3, (0, 0, 400, 300))
    apart = np.abs(centres[:, None] - centres[None])
    assert ((apart[..., 0] >= 30) | (apart[..., 1] >= 16) | np.eye(3, dtype=bool)).all()


# The cameras


def test_the_overlay_puts_a_dot_where_the_feet_are() -> None:
    camera, people = front_camera(), trajectory_of((4, 3, 1.0, 0.0), (4, 5, 3.0, 1.0))
    picture = overlay(camera, GRID, None, people, 4, width=640)
    assert picture.shape == (480, 640, 3)
    for row in people:
        foot = OverlayView(camera, 640).pixel(np.array([row["x"], row["y"]]), 0.0)
        assert at(picture, foot) == track_colour(int(row["id"]))


def test_a_pillar_is_as_tall_as_its_person() -> None:
    view = OverlayView(front_camera(), 640)
    (body,) = pillar_outline(view, np.array([2.0, 0.0]), 1.8)
    foot, head = (view.pixel(np.array([2.0, 0.0]), z) for z in (0.0, 1.8))
    assert abs(body[:, 1].min() - head[1]) < 6 and abs(body[:, 1].max() - foot[1]) < 8
    assert abs(body[:, 0].mean() - foot[0]) < 3


@settings(max_examples=25, deadline=None)
@given(strategies.cameras(), st.floats(1.2, 2.0))
def test_the_axis_of_a_body_is_inside_its_outline(camera: Camera, height: float) -> None:
    view = OverlayView(camera, 640)
    polygons = pillar_outline(view, np.zeros(2), height)
    axis = view.pixel(np.zeros((9, 2)), np.linspace(0.05, 0.95, 9) * height)
    for polygon in polygons:
        inside = [cv2.pointPolygonTest(polygon.astype(np.float32), tuple(map(float, point)), True) for point in axis]
        assert min(inside) > -1


def test_people_whom_the_camera_cannot_see_are_left_out() -> None:
    behind = trajectory_of((0, 1, 2.0, -9.0))
    np.testing.assert_array_equal(
        overlay(front_camera(), GRID, None, behind, 0), overlay(front_camera(), GRID, None, behind[:0], 0)
    )


def test_who_walks_beside_the_picture_leaves_no_trace_in_it() -> None:
    camera = front_camera()
    beside = trajectory_of((0, 1, 9.0, 0.0), (1, 1, 9.0, 0.2))
    pixel = OverlayView(camera, 640).pixel(np.array([9.0, 0.0]), 0.0)
    assert 660 < pixel[0] < 1200
    np.testing.assert_array_equal(
        overlay(camera, GRID, None, beside, 1, width=640), overlay(camera, GRID, None, beside[:0], 1, width=640)
    )


def test_a_trail_reaches_back_as_far_as_asked() -> None:
    walk = trajectory_of(*((frame, 1, 0.3 + 0.1 * frame, 0.0) for frame in range(30)))
    now, short = walk[walk["frame"] == 29], walk[walk["frame"] >= 24]
    camera = front_camera()
    np.testing.assert_array_equal(overlay(camera, GRID, None, walk, 29, 5), overlay(camera, GRID, None, short, 29, 5))
    assert not np.array_equal(overlay(camera, GRID, None, walk, 29, 5), overlay(camera, GRID, None, now, 29, 5))


def test_overlays_show_images_masks_or_the_ground() -> None:
    camera, nobody = front_camera(), trajectory_of()
    colour = np.full((240, 320, 3), (10, 200, 100), np.uint8)
    mask = np.zeros((240, 320), np.uint8)
    mask[100:140, 100:160] = 255
    kept = colour.copy()
    pictures = [overlay(camera, GRID, image, nobody, 0, width=320) for image in (colour, mask, None)]
    assert at(pictures[0], np.array([200, 200])) == (8, 170, 85)
    assert pictures[1][120, 130].min() > pictures[1][20, 300].max() + 40
    assert has(pictures[2], NIGHT) and not np.array_equal(pictures[1], pictures[2])
    np.testing.assert_array_equal(colour, kept)


def test_instances_and_boxes_become_masks() -> None:
    instances = np.array([[0, 300], [2, 0]], np.uint16)
    assert backdrop(instances, (2, 2)).tolist() == [[0, 255], [255, 0]]  # type: ignore[union-attr]
    boxes = Boxes(np.array([[1.0, -5.0, 2.0, 7.0]]), np.ones(1))
    assert backdrop(boxes, (4, 3)).tolist() == [[0, 255, 255, 0]] * 2 + [[0] * 4]  # type: ignore[union-attr]
    assert backdrop(None, (4, 3)) is None


# The volume


def test_slices_show_each_cell_in_its_colour_and_outline_the_tracks() -> None:
    log_odds = np.full(GRID.shape, -4.0, np.float16)
    label = np.zeros(GRID.shape, np.int32)
    label[0, 4:6, 1:3] = 6  # great y: the upper left of the first panel
    log_odds[label > 0] = 4.0
    picture = volume_picture(log_odds, label, GRID, limit=4.0)
    outlined = np.argwhere((picture == track_colour(6)).all(axis=-1))
    hot = np.argwhere((picture == colours_of(np.array(4.0), 4.0)).all(axis=-1))
    cold = np.argwhere((picture == colours_of(np.array(-4.0), 4.0)).all(axis=-1))
    side = np.ptp(outlined[:, 0]) + 1
    assert side == np.ptp(outlined[:, 1]) + 1  # two cells by two
    top_left = cold.min(axis=0)
    np.testing.assert_array_equal(outlined.min(axis=0) - top_left, [0, side // 2])
    inner = hot[(hot >= outlined.min(axis=0)).all(axis=1) & (hot <= outlined.max(axis=0)).all(axis=1)]
    assert len(inner) > 0.3 * side**2


def test_what_no_view_sees_is_hatched_not_coloured() -> None:
    log_odds = np.full(GRID.shape, np.nan)
    picture = volume_picture(log_odds, np.zeros(GRID.shape, np.int32), GRID)
    seen = volume_picture(np.zeros(GRID.shape), np.zeros(GRID.shape, np.int32), GRID)
    greys = np.ptp(picture.astype(int), axis=-1)
    assert picture.shape == seen.shape and not np.array_equal(picture, seen)
    assert np.median(greys) < 6
    assert has(picture, (205, 201, 198)) and has(picture, (236, 234, 232))


def test_the_colour_map_diverges() -> None:
    cold, middle, hot, beyond = colours_of(np.array([-2.0, 0.0, 2.0, np.inf]), 2.0).astype(int)
    assert cold[0] > cold[2] + 40 and hot[2] > hot[0] + 40
    assert np.ptp(middle) == 0 and middle[0] > 240
    np.testing.assert_array_equal(hot, beyond)


def test_the_marginal_is_the_greatest_of_the_planes_that_are_seen() -> None:
    log_odds = np.full(GRID.shape, -3.0)
    log_odds[1, 0, 0], log_odds[0, 0, 0] = 3.0, np.nan
    flat = log_odds.copy()
    flat[:, 0, 0] = 3.0
    label = np.zeros(GRID.shape, np.int32)
    np.testing.assert_array_equal(
        marginal_picture(log_odds, label, GRID, limit=3.0), marginal_picture(flat, label, GRID, limit=3.0)
    )
    label[2, 3, 3] = 2
    assert has(marginal_picture(log_odds, label, GRID), track_colour(2))


# Space and time


def test_time_rises() -> None:
    walk = trajectory_of(*((frame, 1, 2.0, 0.5) for frame in range(20)))
    picture = spacetime_picture(GRID, walk, 5.0, width=600, height=700)
    block = Block.fit(GRID, 0, 19, (600, 700))
    start, end = block.pixel([[2.0, 0.5, 0], [2.0, 0.5, 19]])
    assert picture.shape == (700, 600, 3)
    assert end[1] < start[1] - 100 and abs(end[0] - start[0]) < 1e-6
    assert at(picture, start) == at(picture, end) == track_colour(1)


def test_the_nearer_thread_passes_in_front() -> None:
    near = [(frame, 1, 0.5 + 0.15 * frame, 0.0) for frame in range(21)]
    far = [(frame, 2, 3.5 - 0.15 * frame, 1.0) for frame in range(21)]
    picture = spacetime_picture(GRID, trajectory_of(*near, *far), 5.0, width=600, height=700)
    block = Block.fit(GRID, 0, 20, (600, 700))
    paths = [block.pixel([row[2:] + row[:1] for row in path]) for path in (near, far)]
    fine = [
        np.stack([np.interp(np.linspace(0, 20, 2001), np.arange(21), axis) for axis in path.T], -1) for path in paths
    ]
    apart = np.linalg.norm(fine[0][:, None] - fine[1][None, ::4], axis=-1)
    crossing = fine[0][np.unravel_index(apart.argmin(), apart.shape)[0]]
    assert apart.min() < 1 and at(picture, crossing) == track_colour(1)


@pytest.mark.parametrize("table", [trajectory_of(), trajectory_of((5, 1, 1.0, 0.0))])
def test_empty_and_tiny_runs_have_pictures(table: Rows) -> None:
    assert spacetime_picture(GRID, table, 5.0, width=300, height=300).shape == (300, 300, 3)
    assert plan_view(RIG, table, table).ndim == 3


# Charts


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


def test_doubtful_points_are_stretches_of_a_track_and_pale_in_its_bar() -> None:
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


def test_times_are_written_as_people_say_them() -> None:
    assert [clock_time(second) for second in (0, 12.4, 75, 7385)] == ["0 s", "12.4 s", "1:15", "2:03:05"]


# The page and the command


def pictures_in(page: str) -> list[Bytes]:
    found = re.findall(r"data:image/png;base64,([^\"$]+)\"", page)
    return [decoded(base64.b64decode(data)) for data in found]


def decoded(png: bytes) -> Bytes:
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), np.uint8)


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    return run_files.write_small_run(tmp_path / "small.h5")


def test_the_page_holds_everything_and_loads_nothing(run_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "page.html"
    report(run_file, output=output)
    page = output.read_text()
    words = re.sub(r"data:image/png;base64,[^\"]+", "", page)
    assert not re.search(r"https?:|<link|url\(|src=\"[^\"]|<script[^>]* src|fetch\(|import\(|XMLHttpRequest", words)
    assert "default-src 'none'" in page
    assert len(pictures_in(page)) == 7 + 3 * 2  # plan, space-time and five maps; two cameras at three frames
    for fact in ("hall", "ghosts removed <b>1</b> of 3", "birth <b>2</b>", "entered", "no image from a camera"):
        assert fact in page


def test_an_encounter_is_one_line_and_says_how_long_it_was(tmp_path: Path) -> None:
    recording, path = run_files.small_recording(tmp_path), tmp_path / "met.h5"
    told = [(11, b"merge", 1, 2, b"their cells touch, for 0.4 s"), (13, b"split", 1, 2, b"their cells part")]
    with RunWriter(path, recording, np.ones((3, 4, 6), np.uint8), "", overwrite=False, kept="tracks") as writer:
        run_files.fill(writer)
        writer.append("events", np.array(told, EVENT))
        writer.finish(Tracks(run_files.small_trajectory()).summary())
    report(path, output=tmp_path / "met.html", frame=(11,))
    page = (tmp_path / "met.html").read_text()
    assert "encounter <b>1</b>" in page and "their cells touch, for 0.4 s" in page
    assert "split" not in page.split("<h2>Events</h2>")[1].split("</section>")[0]
    assert "which this run did not keep (--volume tracks)" in page


def test_the_same_run_gives_the_same_page(run_file: Path, tmp_path: Path) -> None:
    pages = [tmp_path / "a.html", tmp_path / "b.html"]
    for page in pages:
        report(run_file, output=page, frame=(12,))
    assert pages[0].read_bytes() == pages[1].read_bytes()


HOSTILE = "<img src=x onerror=alert(1)>'\"&amp;"


def test_names_from_the_run_cannot_write_html(tmp_path: Path) -> None:
    recording = run_files.small_recording(tmp_path)
    cameras = tuple(replace(camera, name=f"{HOSTILE}{k}") for k, camera in enumerate(recording.rig.cameras))
    evil = replace(recording, rig=replace(recording.rig, name=HOSTILE, cameras=cameras))
    path, names = tmp_path / "evil.h5", tmp_path / "names.csv"
    with RunWriter(path, evil, np.ones(evil.rig.grid.shape, np.uint8), run_files.CONFIG, overwrite=False) as writer:
        run_files.fill(writer)
        writer.finish(Tracks(run_files.small_trajectory()).summary())
    names.write_text("id,name\n1,</script><script>alert(1)</script>\n2,</td><img src=x onerror=alert(1)>\n")
    report(path, output=tmp_path / "evil.html", names=names)
    page = (tmp_path / "evil.html").read_text()
    assert page.count("<script") == 2, "the page's data and its own script"
    assert "<img src=x" not in page and "alert(1)</script>" not in page
    assert "&lt;img src=x onerror=alert(1)&gt;" in page and "&lt;script&gt;alert" in page


def test_a_run_without_frames_has_a_page(tmp_path: Path) -> None:
    recording, path = run_files.small_recording(tmp_path), tmp_path / "empty.h5"
    with RunWriter(path, recording, np.ones(recording.rig.grid.shape, np.uint8), "", overwrite=False) as writer:
        writer.finish(np.zeros(0, TRACK))
    report(path, output=tmp_path / "empty.html")
    assert "<title>hall</title>" in (tmp_path / "empty.html").read_text()


@pytest.mark.parametrize("name", ["</script><script>alert(1)", "a\nb", ""])
def test_names_that_no_file_can_have_are_refused(tmp_path: Path, name: str) -> None:
    path = run_files.write_small_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["cameras"] = ["left", name]
    with pytest.raises(FormatError, match="names of cameras"):
        report(path, output=tmp_path / "evil.html")
    assert not (tmp_path / "evil.html").exists()


def test_names_of_cameras_are_not_on_the_numbers_of_the_axes() -> None:
    matrix = np.array([[250.0, 0, 160], [0, 250.0, 120], [0, 0, 1]])
    cameras = []
    for name, (x, y) in {"a camera in the south": (2.0, -1.2), "in the west": (-0.2, 1.0)}.items():
        way = np.array([2.0 - x, 0.5 - y, -1.0])
        way /= np.linalg.norm(way)
        right = np.array([way[1], -way[0], 0.0]) / np.hypot(*way[:2])
        rotation = np.array([right, np.cross(way, right), way])
        place = np.array([x, y, 2.5])
        cameras.append(
            Camera.from_projection(name, (320, 240), matrix @ np.column_stack([rotation, -rotation @ place]))
        )
    nameless = [replace(camera, name=" " * (1 + k)) for k, camera in enumerate(cameras)]
    named, plain = (
        plan_view(Rig("hall", 5.0, GRID, tuple(own)), trajectory_of(), width=700, height=600)
        for own in (cameras, nameless)
    )
    plan = plan_map(Rig("hall", 5.0, GRID, tuple(cameras)), 700, 600)
    (left, _), (_, bottom) = plan.corner, plan.far_corner
    changed = (named != plain).any(axis=2)
    assert changed.any(), "the names"
    assert not changed[round(bottom) + 10 : round(bottom) + 32, round(left) :].any()
    assert not changed[: round(bottom), : round(left) - 10].any()


VIVID = (20, 240, 160)


@pytest.fixture
def filmed_run(tmp_path: Path) -> Path:
    """A run whose cameras deliver images of one vivid colour."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for frame in range(16):
        cv2.imwrite(str(folder / f"{frame:03d}.png"), np.full((12, 16, 3), VIVID, np.uint8))
    recording = run_files.small_recording(tmp_path)
    sources = (CameraSource(Source("images", folder)),) * 2
    recording = replace(recording, sources=sources)
    path = tmp_path / "filmed.h5"
    with RunWriter(path, recording, np.ones(recording.rig.grid.shape, np.uint8), "", overwrite=False) as writer:
        run_files.fill(writer)
        writer.finish(Tracks(run_files.small_trajectory()).summary())
    return path


def test_camera_pixels_are_shown_only_when_asked_for(filmed_run: Path, tmp_path: Path) -> None:
    shown = (17, 204, 136)  # a little darker
    seen = []
    for flag in (False, True):
        output, folder = tmp_path / f"{flag}.html", tmp_path / f"pictures_{flag}"
        report(filmed_run, output=output, frame=(11,), camera_images=flag, pictures=folder)
        page = output.read_text()
        files = [decoded(path.read_bytes()) for path in sorted(folder.glob("*.png"))]
        seen.append([any(has(picture, shown) for picture in pictures) for pictures in (pictures_in(page), files)])
        assert ("shows images from the cameras" in page) is flag
    assert seen == [[False, False], [True, True]]


def test_without_the_flag_no_stream_is_even_opened(run_file: Path, tmp_path: Path) -> None:
    (tmp_path / "left.avi").unlink()
    report(run_file, output=tmp_path / "a.html", frame=(11,))
    with pytest.raises(SourceError):
        report(run_file, output=tmp_path / "b.html", camera_images=True)
    assert not (tmp_path / "b.html").exists()


def test_pictures_are_written_beside_the_page(
    run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report(run_file, output=tmp_path / "a.html", pictures=tmp_path / "one", frame=(11,))
    maps = {"plan", "spacetime", "density", "dwell", "flow", "ghosts", "blind"}
    plain = maps | {"slices", "marginal", "overlay_left", "overlay_right"}
    assert {path.stem for path in (tmp_path / "one").iterdir()} == plain
    assert "a.html" in capsys.readouterr().out
    report(run_file, output=tmp_path / "b.html", pictures=tmp_path / "two", frame=(10, 13))
    names = {path.stem for path in (tmp_path / "two").iterdir()}
    assert {"plan", "slices_10", "slices_13", "overlay_left_13"} <= names and "slices" not in names


def test_truth_adds_scores_of_the_run_s_frames(run_file: Path, tmp_path: Path) -> None:
    rows = [f"{row['frame']},{row['id']},{row['x']},{row['y']}" for row in run_files.small_trajectory()]
    truth = tmp_path / "truth.csv"
    truth.write_text("\n".join(["frame,id,x,y", "3,1,0.1,0.1", *rows, "900,1,0.1,0.1"]))
    report(run_file, output=tmp_path / "a.html", truth=truth, frame=(11,))
    assert "<dt>IDF1</dt><dd>100.0 %</dd>" in (tmp_path / "a.html").read_text()


def test_write_pictures_replaces_older_ones(run_file: Path, tmp_path: Path) -> None:
    run = read_run(run_file)
    first = write_pictures(tmp_path / "out", run.recording, run, None, 12)
    assert first == write_pictures(tmp_path / "out", run.recording, run, run.trajectory, 12)
    assert [path.name for path in first[:3]] == ["plan.png", "spacetime.png", "slices.png"]
    assert all(cv2.imread(str(path)) is not None for path in first)


def test_what_the_user_can_mend_is_told(run_file: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--frame.*found 99.*10 to 15"):
        report(run_file, output=tmp_path / "a.html", frame=(99,))
    (tmp_path / "old.html").write_text("old")
    with pytest.raises(OutputError, match="overwrite"):
        report(run_file, output=tmp_path / "old.html")
    report(run_file, output=tmp_path / "old.html", overwrite=True, frame=(11,))
    assert (tmp_path / "old.html").read_text() != "old"
    with pytest.raises(OutputError):
        report(run_file, output=tmp_path / "a.html", pictures=run_file, frame=(11,))
