"""Pictures of a run agree with its tables: right place, right colour, right way up."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import run_files
import strategies
from checks import drawn
from hypothesis import strategies as st
from run_files import trajectory_of
from scenes import looking

from stseg.arrays import AnyArray, Boxes, Bytes, Floats, Rows
from stseg.geometry import Camera, Grid, Rig
from stseg.reporting.figures import backdrop
from stseg.reporting.pictures.canvas import place_labels
from stseg.reporting.pictures.colours import NIGHT, PAPER, track_colour
from stseg.reporting.pictures.overlay import OverlayView, overlay, pillar_outline
from stseg.reporting.pictures.plan import plan_map, plan_view
from stseg.reporting.pictures.slices import colours_of, marginal_picture, volume_picture
from stseg.reporting.pictures.spacetime import Block, spacetime_picture

GRID = Grid((0.0, 4.0), (-1.0, 2.0), 0.5, 1.8, 3)


def front_camera(y: float = -5.0) -> Camera:
    """Three metres above the ground, looking along y and 20 degrees down."""
    return looking("front", (2.0, y, 3.0), (2.0, y + 3.0 / np.tan(np.radians(20)), 0.0), (320, 240), 250.0)


RIG = Rig("hall", 5.0, GRID, (front_camera(),))


def at(picture: Bytes, pixel: AnyArray) -> tuple[int, int, int]:
    """The colour at a pixel (u, v)."""
    u, v = np.rint(pixel).astype(int)
    blue, green, red = picture[v, u].tolist()
    return blue, green, red


def has(picture: Bytes, colour: tuple[int, int, int]) -> bool:
    return bool((picture == colour).all(axis=-1).any())


def test_few_tracks_have_distinct_colours_and_many_are_thin() -> None:
    colours = np.array([track_colour(k) for k in range(1, 9)], float)
    distances = np.linalg.norm(colours[:, None] - colours[None], axis=-1) + 1e3 * np.eye(8)
    assert distances.min() > 60
    assert all(np.linalg.norm(colours - ground, axis=1).min() > 100 for ground in (PAPER, NIGHT))

    def painted(count: int) -> float:
        rows = [(frame, k, 0.2 + 0.1 * frame, -0.9 + 2.8 * k / count) for k in range(count) for frame in range(35)]
        picture = plan_view(RIG, trajectory_of(*rows))
        plan = plan_map(RIG)
        column = picture[:, int(plan.pixel(np.array([1.75, 0.0]))[0])]
        return float((np.ptp(column.astype(int), axis=1) > 40).sum() / count)

    few, many = painted(8), painted(150)
    assert few >= 3 > 2 >= many > 0


def test_the_plan_shows_tracks_at_their_places_without_gaps() -> None:
    path = [(frame, 7, 0.5 + 0.25 * frame, 1.5 - 0.2 * frame) for frame in range(12)]
    picture = plan_view(RIG, trajectory_of(*path))
    plan = plan_map(RIG)
    assert picture.shape == (plan.size[1], plan.size[0], 3)
    for _, identity, x, y in path[:-1]:
        assert at(picture, plan.pixel(np.array([x, y]))) == track_colour(identity)
    low, high = plan.pixel(np.array([[1.0, 0.0], [3.0, 1.0]]))
    assert high[0] > low[0] and high[1] < low[1]
    np.testing.assert_allclose(high - low, [2 * plan.scale, -plan.scale])
    picture = plan_view(RIG, trajectory_of((0, 1, 1.0, -0.5), (0, 2, 1.0, 1.5)))
    assert at(picture, plan.pixel(np.array([1.0, -0.5]))) == track_colour(1)
    assert at(picture, plan.pixel(np.array([1.0, 1.5]))) == track_colour(2)
    whole = [(frame, 1, 0.5 + 0.1 * frame, 0.3) for frame in range(30)]
    torn = [row for row in whole if not 10 <= row[0] < 20]
    between = plan.pixel(np.stack([np.linspace(1.55, 2.35, 60), np.full(60, 0.3)], -1))
    pictures = [plan_view(RIG, trajectory_of(*rows)) for rows in (whole, torn)]
    assert [sum(at(picture, pixel) == track_colour(1) for pixel in between) for picture in pictures] == [60, 0]


def test_the_plan_shades_few_views_and_holds_any_camera(tmp_path: Path) -> None:
    coverage = np.full(GRID.shape[1:], 3, np.uint8)
    coverage[0, -1] = 0  # least y, greatest x
    picture = plan_view(RIG, trajectory_of(), None, coverage)
    plan = plan_map(RIG)
    unseen, *lighter = (at(picture, plan.pixel(np.array(place))) for place in ((3.8, -0.8), (3.8, 1.8), (0.3, -0.8)))
    assert all(max(unseen) < min(other) for other in lighter)
    far = Rig("hall", 5.0, GRID, (front_camera(-500.0),))
    alone = Rig("hall", 5.0, GRID, ())
    assert plan_map(far) == plan_map(alone)
    assert not np.array_equal(plan_view(far, trajectory_of()), plan_view(alone, trajectory_of()))
    rig = run_files.small_recording(tmp_path).rig
    picture = plan_view(rig, trajectory_of(), width=900, height=900)
    place = plan_map(rig, 900, 900).pixel(rig.cameras[0].centre[:2])
    assert picture.shape[2] == 3 and np.isfinite(place).all()


def test_truth_is_a_dashed_line_that_leaves_tracks_visible() -> None:
    truth = trajectory_of(*((frame, 9, 0.5 + 0.1 * frame, 1.0) for frame in range(30)))
    plain, both = (plan_view(RIG, trajectory_of((0, 1, 1.0, 0.0)), table) for table in (None, truth))
    line = np.rint(plan_map(RIG).pixel(np.stack([np.linspace(0.5, 3.4, 400), np.full(400, 1.0)], -1))).astype(int)
    dark = both[line[:, 1], line[:, 0]].max(axis=1) < 130
    assert 0.3 < dark.mean() < 0.8
    assert not (plain[line[:, 1], line[:, 0]].max(axis=1) < 130).any()
    dense = trajectory_of(*((frame, 1, 0.5 + 0.1 * frame, 1.0) for frame in range(20)))
    sparse = dense.copy()
    sparse["frame"] *= 10
    pictures = [plan_view(RIG, trajectory_of(), truth) for truth in (dense, sparse)]
    np.testing.assert_array_equal(pictures[0], pictures[1])


@drawn(45, strategies.rigs())
def test_any_rig_has_a_plan(rig: Rig) -> None:
    middle = rig.grid.ground[rig.grid.inside()].mean(axis=0)
    picture = plan_view(rig, trajectory_of((0, 3, *middle.tolist())), width=700, height=600)
    plan = plan_map(rig, 700, 600)
    assert picture.shape == (plan.size[1], plan.size[0], 3)
    assert at(picture, plan.pixel(middle))[:2] != PAPER[:2]


@drawn(30, st.lists(st.tuples(st.floats(0, 400), st.floats(0, 300)), max_size=12))
def test_labels_stay_on_the_canvas(points: list[tuple[float, float]]) -> None:
    centres = place_labels(np.array(points).reshape(-1, 2), [(30, 16)] * len(points), (0, 0, 400, 300))
    assert centres.shape == (len(points), 2)
    assert (centres >= (15, 8)).all() and (centres <= (385, 292)).all()


def test_labels_cover_no_labels_points_or_numbers_of_axes() -> None:
    points = np.array([[200.0, 150.0], [206.0, 150.0], [200.0, 156.0], [220.0, 135.0]])
    centres = place_labels(points, [(30, 16)] * 3, (0, 0, 400, 300))
    distances = np.abs(centres[:, None] - centres[None])
    assert ((distances[..., 0] >= 30) | (distances[..., 1] >= 16) | np.eye(3, dtype=bool)).all()
    assert (np.abs(centres - points[3]) >= (15, 8)).any(axis=1).all()
    places = {"a camera in the south": (2.0, -1.2, 2.5), "in the west": (-0.2, 1.0, 2.5)}
    cameras = [looking(name, place, (2.0, 0.5, 1.5), (320, 240), 250.0) for name, place in places.items()]
    nameless = [replace(camera, name=" " * (1 + k)) for k, camera in enumerate(cameras)]
    named, plain = (
        plan_view(Rig("hall", 5.0, GRID, tuple(views)), trajectory_of(), width=700, height=600)
        for views in (cameras, nameless)
    )
    plan = plan_map(Rig("hall", 5.0, GRID, tuple(cameras)), 700, 600)
    (left, _), (_, bottom) = plan.corner, plan.far_corner
    changed = (named != plain).any(axis=2)
    assert changed.any(), "the names"
    assert not changed[round(bottom) + 10 : round(bottom) + 32, round(left) :].any()
    assert not changed[: round(bottom), : round(left) - 10].any()


def test_the_overlay_has_feet_and_pillars_as_tall_as_people() -> None:
    camera, people = front_camera(), trajectory_of((4, 3, 1.0, 0.0), (4, 5, 3.0, 1.0))
    picture = overlay(camera, GRID, None, people, 4, width=640)
    assert picture.shape == (480, 640, 3)
    for row in people:
        foot = OverlayView(camera, 640).pixel(np.array([row["x"], row["y"]]), 0.0)
        assert at(picture, foot) == track_colour(int(row["id"]))
    view = OverlayView(front_camera(), 640)
    (body,) = pillar_outline(view, np.array([2.0, 0.0]), 1.8)
    foot, head = (view.pixel(np.array([2.0, 0.0]), z) for z in (0.0, 1.8))
    assert abs(body[:, 1].min() - head[1]) < 6 and abs(body[:, 1].max() - foot[1]) < 8
    assert abs(body[:, 0].mean() - foot[0]) < 3


@drawn(25, strategies.cameras(), st.floats(1.2, 2.0))
def test_the_axis_of_a_body_is_inside_its_outline(camera: Camera, height: float) -> None:
    view = OverlayView(camera, 640)
    polygons = pillar_outline(view, np.zeros(2), height)
    assert len(polygons)
    axis = view.pixel(np.zeros((9, 2)), np.linspace(0.05, 0.95, 9) * height)
    for polygon in polygons:
        inside = [cv2.pointPolygonTest(polygon.astype(np.float32), tuple(map(float, point)), True) for point in axis]
        assert min(inside) > -1


def test_a_body_without_its_head_in_the_picture_has_its_id(monkeypatch: pytest.MonkeyPatch) -> None:
    places = list[Floats]()
    monkeypatch.setattr("stseg.reporting.pictures.overlay.chips", lambda _, centres, *__: places.append(centres))
    people, view = trajectory_of((0, 1, 1.0, 0.0), (0, 2, 3.0, 1.0)), OverlayView(front_camera(), 640)
    people["height"] = 1.7, 6.0
    overlay(view.camera, GRID, None, people, 0, width=640)
    above = view.pixel(np.array([3.0, 1.0]), 6.0)[1]
    ((_, head), (_, cut)) = places[0]
    assert above < 0 < cut < 100 and head == pytest.approx(view.pixel(np.array([1.0, 0.0]), 1.82)[1])


def test_people_out_of_view_leave_no_trace_and_trails_end() -> None:
    behind = trajectory_of((0, 1, 2.0, -9.0))
    one, other = (overlay(front_camera(), GRID, None, rows, 0) for rows in (behind, behind[:0]))
    np.testing.assert_array_equal(one, other)
    camera = front_camera()
    outside = trajectory_of((0, 1, 9.0, 0.0), (1, 1, 9.0, 0.2))
    assert 660 < OverlayView(camera, 640).pixel(np.array([9.0, 0.0]), 0.0)[0] < 1200
    one, other = (overlay(camera, GRID, None, rows, 1, width=640) for rows in (outside, outside[:0]))
    np.testing.assert_array_equal(one, other)
    walk = trajectory_of(*((frame, 1, 0.3 + 0.1 * frame, 0.0) for frame in range(30)))
    now, short = walk[walk["frame"] == 29], walk[walk["frame"] >= 24]
    np.testing.assert_array_equal(overlay(camera, GRID, None, walk, 29, 5), overlay(camera, GRID, None, short, 29, 5))
    assert not np.array_equal(overlay(camera, GRID, None, walk, 29, 5), overlay(camera, GRID, None, now, 29, 5))


def test_overlays_show_images_masks_boxes_or_the_ground() -> None:
    camera, empty = front_camera(), trajectory_of()
    colour = np.full((240, 320, 3), (10, 200, 100), np.uint8)
    mask = np.zeros((240, 320), np.uint8)
    mask[100:140, 100:160] = 255
    kept = colour.copy()
    pictures = [overlay(camera, GRID, image, empty, 0, width=320) for image in (colour, mask, None)]
    assert at(pictures[0], np.array([200, 200])) == (8, 170, 85)
    assert pictures[1][120, 130].min() > pictures[1][20, 300].max() + 40
    assert has(pictures[2], NIGHT) and not np.array_equal(pictures[1], pictures[2])
    np.testing.assert_array_equal(colour, kept)
    instances = np.array([[0, 300], [2, 0]], np.uint16)
    assert backdrop(instances, (2, 2)).tolist() == [[0, 255], [255, 0]]  # type: ignore[union-attr]
    boxes = Boxes(np.array([[1.0, -5.0, 2.0, 7.0]]), np.ones(1))
    assert backdrop(boxes, (4, 3)).tolist() == [[0, 255, 255, 0]] * 2 + [[0] * 4]  # type: ignore[union-attr]
    assert backdrop(None, (4, 3)) is None


def test_slices_show_cells_outline_tracks_and_hatch_unseen() -> None:
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
    log_odds = np.full(GRID.shape, np.nan)
    picture = volume_picture(log_odds, np.zeros(GRID.shape, np.int32), GRID)
    even = volume_picture(np.zeros(GRID.shape), np.zeros(GRID.shape, np.int32), GRID)
    greys = np.ptp(picture.astype(int), axis=-1)
    assert picture.shape == even.shape and not np.array_equal(picture, even)
    assert np.median(greys) < 6
    assert has(picture, (205, 201, 198)) and has(picture, (236, 234, 232))


def test_colours_diverge_and_marginals_are_the_greatest() -> None:
    cold, middle, hot, infinite = colours_of(np.array([-2.0, 0.0, 2.0, np.inf]), 2.0).astype(int)
    assert cold[0] > cold[2] + 40 and hot[2] > hot[0] + 40
    assert np.ptp(middle) == 0 and middle[0] > 240
    np.testing.assert_array_equal(hot, infinite)
    log_odds = np.full(GRID.shape, -3.0)
    log_odds[1, 0, 0], log_odds[0, 0, 0] = 3.0, np.nan
    flat = log_odds.copy()
    flat[:, 0, 0] = 3.0
    label = np.zeros(GRID.shape, np.int32)
    one, other = (marginal_picture(values, label, GRID, limit=3.0) for values in (log_odds, flat))
    np.testing.assert_array_equal(one, other)
    label[2, 3, 3] = 2
    assert has(marginal_picture(log_odds, label, GRID), track_colour(2))


def test_time_rises_and_the_nearer_thread_is_in_front() -> None:
    walk = trajectory_of(*((frame, 1, 2.0, 0.5) for frame in range(20)))
    picture = spacetime_picture(GRID, walk, 5.0, width=600, height=700)
    block = Block.fit(GRID, 0, 19, (600, 700))
    start, end = block.pixel([[2.0, 0.5, 0], [2.0, 0.5, 19]])
    assert picture.shape == (700, 600, 3)
    assert end[1] < start[1] - 100 and abs(end[0] - start[0]) < 1e-6
    assert at(picture, start) == at(picture, end) == track_colour(1)
    front = [(frame, 1, 0.5 + 0.15 * frame, 0.0) for frame in range(21)]
    far = [(frame, 2, 3.5 - 0.15 * frame, 1.0) for frame in range(21)]
    picture = spacetime_picture(GRID, trajectory_of(*front, *far), 5.0, width=600, height=700)
    block = Block.fit(GRID, 0, 20, (600, 700))
    paths = [block.pixel([row[2:] + row[:1] for row in path]) for path in (front, far)]
    fine = [np.stack([np.interp(np.arange(2001) / 100, np.arange(21), axis) for axis in path.T], -1) for path in paths]
    distances = np.linalg.norm(fine[0][:, None] - fine[1][None, ::4], axis=-1)
    crossing = fine[0][np.unravel_index(distances.argmin(), distances.shape)[0]]
    assert distances.min() < 1 and at(picture, crossing) == track_colour(1)


@pytest.mark.parametrize("table", [trajectory_of(), trajectory_of((5, 1, 1.0, 0.0))])
def test_empty_and_tiny_runs_have_pictures(table: Rows) -> None:
    assert spacetime_picture(GRID, table, 5.0, width=300, height=300).shape == (300, 300, 3)
    assert plan_view(RIG, table, table).ndim == 3
