"""Rigs from people who walk: each part by itself, then the whole way and what it refuses."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import Captured, cases, drawn, in_ci, refused
from films import write_at_rate
from hypothesis import strategies as st
from simulated_people import Walking, changed, delayed, walking

from stseg import Camera, Grid, read_recording, simulate
from stseg.arrays import Bytes, Floats, Singles
from stseg.calibration.adjusted_rig import cameras_of, centred, grid_of, offsets_of, reports_of, scaled
from stseg.calibration.automatic import auto
from stseg.calibration.automatic.auto import align_all, merge_views, placed_views
from stseg.calibration.automatic.correspondence import match_endpoints
from stseg.calibration.automatic.endpoints import Endpoints, upright_endpoints
from stseg.calibration.automatic.floor_features import Marks, floor_marks
from stseg.calibration.automatic.scale import KnownDistance, adjusted_to, measured, scale_spread
from stseg.calibration.automatic.single_view import view_of_upright
from stseg.calibration.automatic.solution import (
    SolvedViews,
    refine_cameras,
    refine_with_marks,
    single_view_cameras,
    view_places,
)
from stseg.calibration.automatic.view_alignment import ViewPlaces, align, mirrored
from stseg.calibration.bundle_adjustment import adjust, residuals
from stseg.calibration.pinhole import CENTRE, ENDS, SIZE, as_camera, height_of_head, looking, moved, on_plane, project
from stseg.commands.calibrate.auto import calibrate_auto
from stseg.engine.reporter import reporter_of
from stseg.errors import ConfigError, SourceError
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig, pixel_rays
from stseg.simulation.rendering.room import render_room
from stseg.tasks.calibration.automatic import _require_plausible, frame_rate_notes, people_of

IMAGE = (480, 360)


def a_view(focal: float = 0.8, pitch: float = 0.4, roll: float = 0.05, k1: float = -0.2) -> Floats:
    view = np.zeros(SIZE)
    view[0], view[3], view[4] = np.log(focal), k1, 0.03
    view[5:8], view[8:11] = looking(pitch, roll), (0.5, -5.0, 2.8)
    return view


def pixels(view: Floats, points: Floats) -> Floats:
    many = np.ones(len(points))
    return project(np.tile(view, (len(points), 1)), many * IMAGE[0], many * IMAGE[1], points)


SPOTS = np.array([[0.0, 0.0, 0.0], [1.5, 0.5, 1.7], [-1.0, 1.0, 0.9], [0.3, -1.0, 1.7]])


@drawn(20, st.floats(0.5, 1.5), st.floats(0.15, 0.7), st.floats(-0.1, 0.1), st.floats(-0.35, 0.1))
def test_a_pinhole_shows_what_its_camera_shows(focal: float, pitch: float, roll: float, k1: float) -> None:
    view = a_view(focal, pitch, roll, k1)
    projected, _ = as_camera(view, "a", IMAGE).project(SPOTS[:, :2], SPOTS[:, 2])
    np.testing.assert_allclose(pixels(view, SPOTS), projected, atol=1e-6)


@drawn(20, st.floats(-3, 3), st.floats(0.5, 2.0))
def test_a_moved_camera_shows_the_moved_world_as_before(turn: float, scale: float) -> None:
    view = a_view()
    about = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    world = scale * SPOTS @ about.T + [1.0, -2.0, 0.0]
    np.testing.assert_allclose(
        pixels(moved(view, turn, np.array([1.0, -2.0]), scale), world), pixels(view, SPOTS), atol=1e-6
    )


def test_ground_heights_and_lens_come_back_from_people() -> None:
    view = a_view()
    ground = np.array([[0.0, 0.0], [1.0, 0.5], [-1.5, 1.0]])
    low = pixels(view, np.column_stack([ground, np.zeros(3)]))
    np.testing.assert_allclose(on_plane(view, IMAGE, low, 0.0), ground, atol=1e-6)
    high = pixels(view, np.column_stack([ground, [1.5, 1.7, 1.9]]))
    np.testing.assert_allclose(height_of_head(view, IMAGE, high, ground), [1.5, 1.7, 1.9], atol=1e-6)
    scene = walking(1, 3, 40.0, noise=0.0)
    camera = scene.rig.cameras[0]
    view, miss = view_of_upright(scene.views.endpoints[0], camera.size, 1.7)
    assert camera.lens is not None
    assert np.exp(view[0]) * camera.size[0] == pytest.approx(camera.lens.matrix[0, 0], rel=0.15)
    assert view[10] == pytest.approx(camera.centre[2], rel=0.1)
    assert miss < 0.05


def painted(*bodies: tuple[float, float, float, float]) -> Singles:
    """A likelihood map (180, 240) of lines with round endpoints from foot to head, 15 pixels wide."""
    image = np.zeros((180, 240), np.uint8)
    for u0, v0, u1, v1 in bodies:
        cv2.line(image, (int(u0), int(v0)), (int(u1), int(v1)), 255, 15)
    return np.asarray(image, np.float32) / np.float32(255)


def test_ends_of_one_who_stands_free_and_of_meetings() -> None:
    for gap, wide in ((0, 1), (4, 1), (0, 7)):  # a narrow silhouette breaks at the neck; a mask is 3 pixels too wide
        (image := painted((100, 150, 110, 80)))[92 : 92 + gap] = 0
        found = upright_endpoints(np.asarray(cv2.dilate(image, np.ones((wide, wide))), np.float32))
        np.testing.assert_allclose(found, [[[99, 157.5], [111, 72.5]]], atol=2)
    frame, pixel = np.arange(12), np.zeros((12, 2))
    endpoints = [Endpoints(frame + late, pixel, pixel - [0, 50]) for late in (0, 3)]
    ground = np.stack([0.2 * frame, np.zeros(12)], 1)
    met = match_endpoints(endpoints, np.array([0, 3]), [ground, ground + 0.1], 0.4, 5.0)
    assert len(met.frame) == 12 and len(met.view) == 24 and set(met.person) == {0}
    np.testing.assert_allclose(met.velocity[1:-1], np.tile([1.0, 0.0], (10, 1)))
    assert len(match_endpoints(endpoints, np.array([0, 3]), [ground, ground + 1.0], 0.4, 5.0).frame) == 0


@cases()
def test_who_is_not_whole_free_and_upright_has_no_ends(bodies: list[tuple[float, float, float, float]]) -> None:
    assert upright_endpoints(painted(*bodies)).shape == (0, 2, 2)


def true_walks(scene: Walking) -> list[ViewPlaces]:
    return [
        ViewPlaces(endpoints.frame, camera.back_project(endpoints.foot) @ np.array([1, 1j]))
        for camera, endpoints in zip(scene.rig.cameras, scene.views.endpoints, strict=True)
    ]


@drawn(9, st.floats(-3, 3), st.integers(-8, 8))
def test_views_are_aligned_by_turn_shift_and_delay(turn: float, delay: int) -> None:
    a = true_walks(walking(2, 2, 30.0, 0))[0]
    b = ViewPlaces(a.frame + delay, np.exp(1j * turn) * a.place + 2 - 1j)
    best = align(a, b, 5.0, 10)[0]
    assert best.delay == delay and best.support > 0.9 * len(a.frame)
    assert abs(best.factor - np.exp(1j * turn)) < 0.02 and abs(best.shift - (2 - 1j)) < 0.05
    assert align(a, mirrored(b), 5.0, 10)[0].support < 0.6 * best.support
    beyond = ViewPlaces(a.frame, np.where(np.arange(len(a.frame)) == 5, complex(np.nan, np.nan), a.place))
    assert abs(align(beyond, b, 5.0, 10)[0].factor - best.factor) < 0.005
    still = ViewPlaces(a.frame, np.where(np.arange(len(a.frame)) < 3, a.place, 1.0 + 0j))
    assert all(np.isfinite(one.factor) for one in align(still, still, 5.0, 10))


DELAYS = [0, 4, -3]


@pytest.fixture(scope="module")
def scene() -> Walking:
    return delayed(walking(seconds=26.0), DELAYS)


@pytest.fixture(scope="module")
def solution(scene: Walking) -> SolvedViews:
    return auto.calibrate_from_people(NAMES, scene.views, lambda: None)


NAMES = ["a", "b", "c"]


def ground_errors(scene: Walking, solution: SolvedViews) -> tuple[Floats, float]:
    """Errors on the ground after the best similarity, metres, and its scale."""
    projected, true = [], []
    for camera, made in zip(scene.rig.cameras, cameras_of(solution, NAMES), strict=True):
        ground = scene.rig.grid.ground[::6, ::6].reshape(-1, 2)
        pixel, ahead = camera.project(ground, 0.0)
        visible = ahead & camera.inside(pixel)
        true.append(ground[visible] @ [1, 1j])
        projected.append(made.back_project(pixel[visible]) @ [1, 1j])
    x, y = np.concatenate(projected), np.concatenate(true)
    factor = np.vdot(x - x.mean(), y - y.mean()) / np.vdot(x - x.mean(), x - x.mean())
    return np.abs(factor * (x - x.mean()) - (y - y.mean())), float(abs(factor))


@pytest.mark.slow
def test_the_whole_way_is_as_near_as_it_says_without_floor(scene: Walking, solution: SolvedViews) -> None:
    assert (solution.delay - solution.delay[0]).tolist() == DELAYS
    assert offsets_of(solution).tolist() == [-3, -7, 0]
    error, scale = ground_errors(scene, solution)
    assert np.median(error) < 0.05 and np.percentile(error, 95) < 0.10
    assert scale == pytest.approx(1.0, abs=0.02)
    for camera, report in zip(scene.rig.cameras, reports_of(solution, 0.0), strict=True):
        assert camera.lens is not None and abs(report.focal - camera.lens.matrix[0, 0]) < 4 * report.focal_spread + 1
        assert 0 < report.centre_spread < 0.5 and report.foot_pixels < 4 and report.observations > 100
    bare = [np.full((height, width, 3), 120, np.uint8) for width, height in scene.views.sizes]
    same, marks = auto.sharpen_by_floor(scene.views, solution, bare)
    assert marks == 0 and same is solution


def test_known_distances_fix_scale_uncertainties_and_grid(solution: SolvedViews) -> None:
    turned = scaled(centred(solution), 1.3)
    for one in (solution, turned):
        missed = residuals(one.adjustment.parameters, one.problem)
        np.testing.assert_allclose(missed, solution.adjustment.residual, atol=2e-3)
    pixel = np.array([[150.0, 250.0], [300.0, 260.0]])
    known = [KnownDistance(1, pixel, 3.0)]
    refused(ConfigError, "shows no ground", _require_plausible, solution, [KnownDistance(1, -9 * pixel, 3.0)])
    refused(ConfigError, "makes people .* m tall", _require_plausible, solution, [KnownDistance(1, pixel, 300.0)])
    larger = adjusted_to(solution, known)
    assert measured(larger, known) == pytest.approx(3.0)
    assert scale_spread(larger, known) < 0.03 < scale_spread(solution, []) < 0.1
    spread = [reports_of(one, 0.1)[0].centre_spread for one in (solution, scaled(solution, 2.0))]
    away = np.linalg.norm(solution.adjustment.parameters.views[0, 8:11])
    assert spread[0] > 0.1 * away and spread[1] == pytest.approx(2 * spread[0])
    again = replace(solution, adjustment=adjust(solution.adjustment.parameters, solution.problem))
    assert scale_spread(again, []) == pytest.approx(scale_spread(solution, []), rel=0.02), "the covariance turns, too"
    grid, points = grid_of(solution, 0.1), solution.adjustment.parameters.points
    for axis, (low, high) in enumerate((grid.x, grid.y)):
        assert low < np.percentile(points[:, axis], 2) and np.percentile(points[:, axis], 98) < high


@pytest.mark.slow
def test_a_delay_that_is_a_frame_wrong_is_mended(scene: Walking, solution: SolvedViews) -> None:
    wrong = solution.delay + np.array([0, 0, 1])
    again = refine_cameras(scene.views, solution.adjustment.parameters.views.copy(), wrong, lambda: None)
    assert (again.delay - again.delay[0]).tolist() == DELAYS


@pytest.mark.parametrize("count", [3, *in_ci(1)])
def test_known_distances_make_the_plan_right(scene: Walking, solution: SolvedViews, count: int) -> None:
    ground = np.array([[[-1.0, 0.0], [1.5, 0.0]], [[0.0, -1.0], [0.0, 1.5]], [[-1.0, -1.0], [1.0, 1.0]]])[:count]
    pixels = [scene.rig.cameras[k].project(pair, np.zeros(2))[0] for k, pair in enumerate(ground)]
    metres = np.linalg.norm(ground[:, 1] - ground[:, 0], axis=1)
    known = [KnownDistance(k, pair, float(metres[k])) for k, pair in enumerate(pixels)]
    _, scale = ground_errors(scene, adjusted_to(solution, known))
    assert scale == pytest.approx(1.0, abs=0.015 if count == 1 else 0.01)


def judge(places: list[ViewPlaces]) -> None:
    auto.require_merged(NAMES, places, auto.merge_views(places, auto.align_all(places, 5.0, 10, lambda: None)), 5.0, 10)


@pytest.mark.slow
def test_other_times_mirrors_few_and_wide_people_are_found(scene: Walking) -> None:
    a, b, c = true_walks(scene)
    judge([a, b, c])
    refused(SourceError, r"^c: .* at the same time", judge, [a, b, replace(c, frame=c.frame + 500)])
    refused(SourceError, r"^b: .* mirror", judge, [a, mirrored(b), c])
    endpoints = scene.views.endpoints[0]
    still = Endpoints(endpoints.frame, 0 * endpoints.foot + [200, 300], 0 * endpoints.head + [200, 200])
    few = endpoints.of(np.arange(10))
    for wrong, message in ((still, r"^a: .* stay in one place"), (few, r"^a: found 10 isolated people")):
        refused(SourceError, message, auto.calibrate_from_people, NAMES, changed(scene, 0, wrong).views, lambda: None)
    beyond, views = np.array([3.0, -3.0, 0.0]), []
    for one, pixels in zip(scene.views.endpoints, beyond, strict=True):
        way = pixels * (one.foot - one.head) / one.length[:, None]
        views.append(replace(one, foot=one.foot + way, head=one.head - way))
    found = auto.calibrate_from_people(NAMES, replace(scene.views, endpoints=tuple(views)), lambda: None)
    ends = IMAGE[0] * found.adjustment.parameters.views[:, ENDS].T
    np.testing.assert_allclose(ends - ends.mean(axis=1, keepdims=True), [beyond] * 2, atol=1.0)


def film(path: Path, endpoints: Endpoints, frames: int) -> None:
    """A lossless video of masks in which bodies are thick lines."""
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"FFV1"), 5.0, IMAGE, False)
    for frame in range(frames):
        image = np.zeros(IMAGE[::-1], np.uint8)
        for k in np.flatnonzero(endpoints.frame == frame):
            foot, head, wide = endpoints.foot[k], endpoints.head[k], round(0.2 * float(endpoints.length[k]))
            inwards = (foot - head) / endpoints.length[k] * wide / 2
            low, high = np.rint([foot - inwards, head + inwards]).astype(int).tolist()
            cv2.line(image, low, high, 255, wide)
        writer.write(image)
    writer.release()


@pytest.mark.slow
def test_the_command_makes_a_rig_of_videos(tmp_path: Path, capsys: Captured) -> None:
    scene = walking(2, 2, 20.0)
    videos = [tmp_path / "a.avi", tmp_path / "b.avi"]
    for video, endpoints in zip(videos, scene.views.endpoints, strict=True):
        film(video, endpoints, 100)
    output = tmp_path / "rig.toml"
    distance = ("a,150,250,300,260,3",)
    calibrate_auto(*videos, output=output, source_kind="masks", most_delay=0.0, distance=distance)
    recording = read_recording(output)
    assert [camera.name for camera in recording.rig.cameras] == ["a", "b"]
    ground = recording.rig.cameras[0].back_project(np.array([[150.0, 250.0], [300.0, 260.0]]))
    assert np.linalg.norm(ground[1] - ground[0]) == pytest.approx(3.0, abs=0.01)
    assert "distance in a: 3.000 m instead of 3 (+0.0 %)" in capsys.readouterr().out


def test_deep_shadows_move_no_feet(tmp_path: Path) -> None:
    simulate(tmp_path, scene="easy", people=1, cameras=2, seconds=6.0, frame_rate=5.0, size=(240, 180), shadows=0.65)
    recording = read_recording(tmp_path / "rig.toml")
    truth = np.genfromtxt(tmp_path / "truth.csv", delimiter=",", names=True)
    views, _ = people_of(recording, None, 1.7, 0.0, reporter_of(None))
    for camera, found in zip(recording.rig.cameras, views.endpoints, strict=True):
        row = truth["frame"].searchsorted(found.frame)
        pixel, _ = camera.project(np.column_stack([truth["x"][row], truth["y"][row]]), 0.0)
        assert len(row) > 20 and np.median(np.hypot(*(pixel - found.foot).T)) < 4.0


@cases()
def test_bad_options_are_told(tmp_path: Path, options: dict[str, tuple[str, ...] | str | float], message: str) -> None:
    for name in ("a", "b"):
        film(tmp_path / f"{name}.avi", walking(1, 1, 2.0).views.endpoints[0], 3)
    given = {"frame_rate": 5.0, "source_kind": "masks", **options}
    with pytest.raises(ConfigError, match=message):
        calibrate_auto(tmp_path / "a.avi", tmp_path / "b.avi", output=tmp_path / "rig.toml", **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(("frame_rate", "count"), [(5.2, 0), (25.0, 1)])
def test_another_frame_rate_is_named(tmp_path: Path, frame_rate: float, count: int) -> None:
    film = write_at_rate(tmp_path / "a.avi", [np.zeros((48, 64, 3), np.uint8)] * 5, 5.0)
    notes = frame_rate_notes([film], frame_rate)
    assert len(notes) == count and all("has 5 frames per second by its header, not 25" in note for note in notes)


def test_videos_need_different_names_and_more_than_one(tmp_path: Path) -> None:
    a, b, rig = (tmp_path / name for name in ("a.avi", "b.avi", "rig.toml"))
    refused(ConfigError, "two or more, with different names", calibrate_auto, a, output=rig, frame_rate=5.0)
    refused(SourceError, "no such file", calibrate_auto, a, b, output=rig, frame_rate=5.0)
    for path, rate in ((a, 5.0), (b, 4.0)):
        write_at_rate(path, [np.zeros((48, 64, 3), np.uint8)] * 5, rate)
    refused(ConfigError, "--frame-rate: found 4 and 5 by the headers", calibrate_auto, a, b, output=rig)


SPEC = SceneSpec("walking", 2, (6.0, 6.0), 40.0, 5.0, 2, seed=1, distortion=(-0.2, 0.03))
GRID = Grid((-2.5, 2.5), (-2.5, 2.5))


def room(camera: Camera) -> Bytes:
    return render_room(SPEC, pixel_rays(camera), camera.centre).image


@pytest.fixture(scope="module")
def cameras() -> tuple[Camera, ...]:
    return build_rig(SPEC).cameras


@pytest.fixture(scope="module")
def marks(cameras: tuple[Camera, ...]) -> Marks:
    shifted = replace(cameras[1], ground=cameras[1].ground @ np.array([[1, 0, 0.08], [0, 1, -0.05], [0, 0, 1.0]]))
    return floor_marks([room(camera) for camera in cameras], [cameras[0], shifted], GRID)


def test_marks_are_the_same_place_in_both_views(cameras: tuple[Camera, ...], marks: Marks) -> None:
    places = [camera.back_project(marks.pixel[:, side]) for side, camera in enumerate(cameras)]
    away = np.linalg.norm(places[0] - places[1], axis=1)
    assert len(marks) >= 30 and np.median(away) < 0.05 and np.percentile(away, 90) < 0.12
    assert np.median(np.linalg.norm(places[0] - marks.ground, axis=1)) < 0.1


@pytest.mark.slow
def test_marks_bring_cameras_nearer_to_the_truth() -> None:
    scene = walking(2, 2, 12.0, noise=2.0)
    single_cameras = single_view_cameras(scene.views, lambda: None)
    places = view_places(scene.views, single_cameras)
    merged = merge_views(places, align_all(places, 5.0, 0, lambda: None))
    by_people = refine_cameras(scene.views, placed_views(single_cameras, merged), np.zeros(2, np.int64), lambda: None)
    true = exact_marks(scene)
    by_both = refine_with_marks(scene.views, by_people, true)
    assert disagreement(by_both, true) < 0.5 * disagreement(by_people, true)
    assert by_both.adjustment.residual.shape == by_people.adjustment.residual.shape
    assert refine_with_marks(scene.views, by_people, true.of(np.zeros(0, np.int64))) is by_people
    assert np.isfinite(by_both.adjustment.parameters.views[:, CENTRE]).all()


def exact_marks(scene: Walking) -> Marks:
    ground = np.stack(np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-2, 2, 9)), -1).reshape(-1, 2)
    pixel = np.stack([camera.project(ground, 0.0)[0] for camera in scene.rig.cameras], 1)
    visible = np.all([camera.inside(pixel[:, k]) for k, camera in enumerate(scene.rig.cameras)], axis=0)
    return Marks(np.tile([0, 1], (int(visible.sum()), 1)), pixel[visible], 0 * ground[visible])


def disagreement(solution: SolvedViews, marks: Marks) -> float:
    """Median distance of the two places that the views have a mark at, metres."""
    places: list[Floats] = [
        camera.back_project(marks.pixel[:, side]) for side, camera in enumerate(cameras_of(solution, ["a", "b"]))
    ]
    return float(np.median(np.linalg.norm(places[0] - places[1], axis=1)))
