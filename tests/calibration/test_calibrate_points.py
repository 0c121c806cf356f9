"""Calibration from clicked points, and a lens from a rendered video of a checkerboard."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import Captured, cases, drawn, examples, in_ci, refused
from films import write_at_rate
from recordings import track, write_recording
from scenes import looking, rig_of, walkers
from strategies import BARREL, Pose, poses

from stseg import Camera, Grid, Source, calibrate_points, errors, evaluate, read_recording, read_run
from stseg.arrays import Bytes, Floats
from stseg.calibration.points.camera_models import Points
from stseg.calibration.points.point_fit import PointFit, fit_points
from stseg.calibration.points.point_requirements import require_plane
from stseg.commands.calibrate.app import app
from stseg.commands.calibrate.lens import calibrate_lens
from stseg.errors import CalibrationError, ConfigError
from stseg.geometry.fits import fit_homography, focal_of_square_pixels, middle_matrix, vertical_of_matrix
from stseg.io.calibrations.point_files import read_points
from stseg.io.calibrations.xml_files import read_opencv_lens
from stseg.tasks.calibration.points import fit_warnings

SIZE = (640, 480)
GRID = Grid((-2.0, 2.0), (-2.0, 2.0))
SPREAD = np.array([[-1.5, -1.5], [1.5, -1.4], [1.4, 1.5], [-1.5, 1.3], [0.2, 0.1], [-0.6, 0.9], [0.9, -0.5]])
DOOR = np.array([[-1.5, -1.5], [1.5, -1.4], [0.9, -0.5]])


WALL = np.array([[x, 4.0, z] for x in (-1.5, 0.1, 1.5) for z in (1.5, 2.8)])
OFF_WALL = np.array([[-0.8, 3.0, 2.2], [0.9, 3.2, 1.9]])


def measured(view: Camera, place: Floats) -> Points:
    return Points(view.project(place[:, :2], place[:, 2])[0], place[:, :2], place[:, 2])


def camera(turn: float = 0.7, distortion: tuple[float, ...] | None = None) -> Camera:
    place = (5 * np.cos(turn), 5 * np.sin(turn), 2.6)
    return looking("cam", place, (0.1, 0.0, 0.3), SIZE, 520.0, distortion)


def points_of(view: Camera, ground: Floats = SPREAD, high: Floats | None = DOOR) -> Points:
    """Points on the ground, and others two metres above it."""
    high = np.zeros((0, 2)) if high is None else high
    height = np.concatenate([np.zeros(len(ground)), np.full(len(high), 2.0)])
    return measured(view, np.column_stack([np.concatenate([ground, high]), height]))


def fit(points: Points, view: Camera) -> PointFit:
    return fit_points("cam", SIZE, points, view.lens)


def off(found: Camera, true: Camera) -> float:
    """Largest distance in the image over the area and a body's height, pixels."""
    ground = np.stack(np.meshgrid(np.linspace(-2, 2, 5), np.linspace(-2, 2, 5)), -1)
    errors = [found.project(ground, z)[0] - true.project(ground, z)[0] for z in (0.0, 0.9, 1.8)]
    return float(np.abs(errors).max())


class TestFit:
    @pytest.mark.parametrize("distortion", [None, BARREL])
    @pytest.mark.parametrize("high", [DOOR, None])
    def test_exact_points_give_the_camera_back(self, distortion: tuple[float, ...] | None, high: Floats | None) -> None:
        true = camera(distortion=distortion)
        found = fit(points_of(true, high=high), true)
        assert off(found.camera, true) < 1e-4
        assert found.vertical_from == ("lens" if distortion else "square pixels")
        assert found.off_pixel.max() < 1e-4 and found.off_ground.max() < 1e-6
        assert not found.out.any()

    def test_points_reveal_cameras_or_hide_lenses_by_their_number(self) -> None:
        square = camera()
        matrix = np.array([[1.0, 0.0, 90.0], [0.0, 1.3, -60.0], [0.0, 0.0, 1.0]])  # a crop, pixels that are not square
        true = Camera.from_projection("cam", SIZE, matrix @ square.projection)
        found = fit(points_of(true), true)
        assert found.vertical_from == "points" and off(found.camera, true) < 1e-3
        points = points_of(camera(distortion=BARREL), 1.6 * SPREAD, None)
        assert any("the lens bends" in word for word in fit_warnings(fit_points("cam", SIZE, points), GRID))
        ground, view = np.random.default_rng(1).uniform(-2, 2, (20_000, 2)), camera()
        pixel = view.project(ground, 0.0)[0]
        require_plane("cam", ground, pixel)
        np.testing.assert_allclose(
            fit_homography(ground, pixel), view.ground / np.linalg.norm(view.ground[2]), atol=1e-6
        )

    @pytest.mark.parametrize("askew", [0.0, 2.0])
    def test_a_wall_stands_for_the_ground(self, askew: float) -> None:
        true = looking("cam", (0.2, -3.0, 1.6), (0.2 + askew, 4.0, 2.6), SIZE, 520.0)
        found = fit(measured(true, np.concatenate([WALL, OFF_WALL])), true)
        assert off(found.camera, true) < 1e-3 and found.inner.low.sum() == len(WALL)
        assert np.nanmax(found.ground_deviation(GRID)) < 0.5, "the lowest plane that it sees"

    @pytest.mark.parametrize("wrong", [False, True])
    def test_a_lens_is_found_where_points_bear_it_out(self, wrong: bool) -> None:
        true = camera(distortion=(-0.25, 0.06))
        points = points_of(true, np.concatenate([SPREAD, [[1.9, -1.9], [-1.9, 1.9]]]))
        pixel = points.pixel + np.random.default_rng(5).normal(0, 0.5, points.pixel.shape)
        pixel[2] += (40.0 * wrong, 0.0)
        found = fit_points("cam", SIZE, Points(pixel, points.ground, points.height))
        assert found.vertical_from == "radial lens" and np.flatnonzero(found.out).tolist() == [2] * wrong
        assert off(found.camera, true) < 8 and found.off_ground[~found.inner.low].max() < 0.1, "as long as the error"

    @pytest.mark.parametrize("seed", range(6))
    def test_errors_of_clicks_stay_what_they_are(self, seed: int) -> None:
        true = camera()
        points = points_of(true)
        lots = np.random.default_rng(seed)
        noisy = Points(points.pixel + lots.normal(0, 1, points.pixel.shape), points.ground, points.height)
        assert off(fit(noisy, true).camera, true) < 12

    @pytest.mark.parametrize("wrong", range(7))
    @pytest.mark.parametrize(("jump", "high"), [((60.0, -45.0), DOOR), ((-400.0, 300.0), None)])
    def test_one_wrong_point_is_pointed_out_and_does_no_harm(
        self, wrong: int, jump: tuple[float, float], high: Floats | None
    ) -> None:
        true = camera()
        points = points_of(true, np.concatenate([SPREAD, [[0.5, 1.2], [-1.2, -0.3]]]), high)
        pixel = points.pixel + np.random.default_rng(5).normal(0, 0.3, points.pixel.shape)
        pixel[wrong] += jump
        found = fit(Points(pixel, points.ground, points.height), true)
        assert np.flatnonzero(found.out).tolist() == [wrong] and found.camera.lens is None
        assert off(found.camera, true) < 6

    def test_covariance_is_what_repeated_clicks_scatter_by(self) -> None:
        true = camera()
        points, lots = points_of(true, high=None), np.random.default_rng(3)
        places, deviations = [], []
        target = np.array([[1.75, 1.75]])
        pixel = true.project(target, 0.0)[0]
        row, column = 37, 37
        for _ in range(examples(60)):
            noisy = Points(points.pixel + lots.normal(0, 1.5, points.pixel.shape), points.ground, points.height)
            found = fit(noisy, true)
            places.append(found.camera.back_project(pixel)[0])
            deviations.append(found.ground_deviation(GRID)[row, column])
        scatter = np.sqrt(np.linalg.eigvalsh(np.cov(np.array(places).T))[-1])
        assert 0.6 < np.median(deviations) / scatter < 1.6


class TestSpread:
    def test_points_in_a_corner_are_warned_of(self) -> None:
        true = camera()
        corner = SPREAD * 0.15 + (-1.4, -1.4)
        (words,) = fit_warnings(fit(points_of(true, corner, None), true), GRID)
        assert "cam: its points are badly spread" in words and "add points there" in words
        assert fit_warnings(fit(points_of(true), true), GRID) == []

    @pytest.mark.parametrize(("times", "message"), [(0.5, "another size?"), (1.0, "a fifth"), (2.0, "another size?")])
    def test_four_points_and_pixels_of_another_image_are_named(self, times: float, message: str) -> None:
        seen = points_of(camera(), SPREAD[:4])
        words = fit_warnings(fit_points("cam", SIZE, Points(times * seen.pixel, seen.ground, seen.height)), GRID)
        assert sum(message in word for word in words) == 1


class TestSquarePixels:
    @drawn(100, poses())
    def test_focal_length_and_vertical_are_found(self, pose: Pose) -> None:
        matrix = middle_matrix(pose.matrix[0, 0], SIZE)
        projection = matrix @ np.column_stack([pose.rotation, pose.translation])
        homography = fit_homography(SPREAD, Camera.from_projection("c", SIZE, projection).project(SPREAD, 0.0)[0])
        focal = focal_of_square_pixels(homography, SIZE)
        assert focal is not None and focal == pytest.approx(matrix[0, 0], rel=1e-4)
        found = Camera("c", SIZE, homography, vertical_of_matrix(homography, middle_matrix(focal, SIZE)))
        np.testing.assert_allclose(found.centre, -pose.rotation.T @ pose.translation, rtol=1e-3, atol=1e-3)

    def test_straight_down_tells_nothing(self) -> None:
        down = looking("cam", (0.0, 1e-9, 4.0), (0.0, 0.0, 0.0), SIZE, 300.0)
        said = r"leaves its focal length open.*two or more points with z"
        refused(CalibrationError, said, fit, points_of(down, high=None), down)
        assert off(fit(points_of(down), down).camera, down) < 1e-3


def swapped(points: Points, columns: str) -> Points:
    pixel = points.pixel[:, ::-1] if columns == "uv" else points.pixel
    ground = points.ground[:, ::-1] if columns == "xy" else points.ground
    ground = ground * ((1, -1) if columns == "y down" else (1, 1))
    return Points(pixel, ground, points.height)


class TestWrongPoints:
    @pytest.mark.parametrize("high", [DOOR, None])
    @pytest.mark.parametrize("columns", ["xy", *in_ci("y down", "uv")])
    def test_a_mirrored_camera_is_named(self, columns: str, high: Floats | None) -> None:
        points = swapped(points_of(camera(), high=high), columns)
        refused(CalibrationError, "camera cam: points: found a mirrored ground", fit, points, camera())

    @cases()
    def test_points_that_fix_nothing_are_named(self, ground: list[list[float]], complaint: str) -> None:
        points = points_of(camera(), np.array(ground, float), None)
        refused(CalibrationError, rf"camera cam: points: found {complaint}", fit, points, camera())


def table(path: Path, change: Callable[[str, list[float]], list[float]] = lambda _, row: row) -> Path:
    """The points of four cameras as a CSV file."""
    lines = ["camera,u,v,x,y,z"]
    for name, turn in (("a", 0.7), ("b", 2.3), ("c", 3.9), ("d", 5.4)):
        points = points_of(camera(turn))
        for (u, v), (x, y), z in zip(points.pixel, points.ground, points.height, strict=True):
            lines.append(",".join([name, *(f"{cell:.3f}" for cell in change(name, [u, v, x, y, z]))]))
    path.write_text("\n".join(lines) + "\n")
    return path


def run(*tokens: str) -> None:
    streams = ("--size=640,480", "--source-pattern={name}.avi") if len(tokens) < 3 else ()
    options = (*streams, "--area=-2,-2,2,2", "--frame-rate=8", "-o=room.toml")
    app(["points", *tokens, *options], exit_on_error=False, print_error=False, result_action="return_value")


class TestCommand:
    @pytest.fixture(autouse=True)
    def _here(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)

    def test_points_make_a_rig(self, capsys: Captured) -> None:
        table(Path("p.csv"))
        refused(ConfigError, r"--lens: found 'lens.xml', expected a path with", run, "p.csv", "--lens=lens.xml")
        run("p.csv")
        cameras = read_recording("room.toml").rig.cameras
        assert [view.name for view in cameras] == ["a", "b", "c", "d"]
        assert max(off(view, camera(turn)) for view, turn in zip(cameras, (0.7, 2.3, 3.9, 5.4), strict=True)) < 0.05
        printed = capsys.readouterr().out
        assert "off px" in printed and "off cm" in printed
        assert "square pixels" in printed
        sources = {"a": Source("video", Path("a.avi"))}
        make = partial(
            calibrate_points, "p.csv", "q.toml", size=(640, 480), grid=Grid((-2, 2), (-2, 2)), frame_rate=8.0
        )
        refused(ConfigError, "sources: found a, expected one of camera b", make, sources=sources)

    def test_millimetres_are_named_and_taken(self) -> None:
        table(Path("p.csv"), lambda _, row: [*row[:2], *(1000 * cell for cell in row[2:])])
        refused(CalibrationError, r"a, lines 2 to 11, --unit m: found a camera 2600 m .*\(--unit mm\)", run, "p.csv")
        run("p.csv", "--unit=mm")
        assert off(read_recording("room.toml").rig.cameras[0], camera(0.7)) < 0.05

    def test_lenses_are_used(self) -> None:
        lens = camera(distortion=BARREL).lens
        assert lens is not None
        nodes = (("camera_matrix", lens.matrix), ("distortion_coefficients", lens.distortion))
        words = [f"<{name}>{' '.join(map(repr, values.ravel().tolist()))}</{name}>" for name, values in nodes]
        Path("cam.xml").write_text(f"<opencv_storage>{''.join(words)}</opencv_storage>")
        points = points_of(camera(distortion=BARREL), 1.6 * SPREAD, None)
        rows = [f"cam,{u},{v},{x},{y}" for (u, v), (x, y) in zip(points.pixel, points.ground, strict=True)]
        Path("p.csv").write_text("\n".join(["camera,u,v,x,y", *rows]))
        run("p.csv", "--lens={name}.xml")
        assert off(read_recording("room.toml").rig.cameras[0], camera(distortion=BARREL)) < 0.01

    @pytest.mark.slow
    def test_people_are_tracked_where_no_floor_is_seen(self) -> None:
        """Cameras at head height look up a little, over the back wall; points of it make the rig."""
        places = (-3.4, -3.3, 1.6), (0.2, -4.2, 1.7), (3.3, -3.4, 1.5)
        cameras = [looking(f"c{k}", place, (0.1, 0.2, 2.5), (160, 90), 130.0) for k, place in enumerate(places)]
        rig = rig_of(cameras)
        assert not any((camera.inside(camera.project(rig.grid.ground, 0.0)[0])).any() for camera in cameras)
        write_recording(Path(), 16, rig)
        lines = ["camera,u,v,x,y,z"]
        for view in cameras:
            points = measured(view, np.concatenate([WALL, OFF_WALL]))
            rows = np.round(np.column_stack([points.pixel, points.place]), 1)
            lines += [",".join([view.name, *map(str, row)]) for row in rows.tolist()]
        Path("p.csv").write_text("\n".join(lines))
        run("p.csv", "--size=160,90", "--source-pattern={name}.csv", "--source-kind=boxes", "--overwrite")
        assert track(Path("room.toml"), Path("room.h5")) == 0
        assert float(evaluate(walkers(16), read_run("room.h5").trajectory).moda or 0) >= 95

    @cases(("camera,u,v,x,y\n" + "a,1,2,3,4\n" * 20_001, "FormatError", r"line 20002: found more than 20000 rows"))
    def test_says_what_to_mend(self, text: str, kind: str, complaint: str) -> None:
        Path("p.csv").write_text(text)
        refused(getattr(errors, kind), complaint, run, "p.csv")
        assert not Path("room.toml").exists()


def test_points_are_read_as_they_stand(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("camera, u, v, x, y, z, note\nb,1,2,3,4,,floor\na,5,6,7,8,2.1,door\nb,9,8,7,6,0,floor\n")
    first, second = read_points(path)
    assert (first.camera, second.camera) == ("b", "a")
    assert first.pixel.tolist() == [[1, 2], [9, 8]] and first.line.tolist() == [2, 4]
    assert second.place.tolist() == [[7, 8, 2.1]]


LENS_SIZE, BOARD = (640, 480), (7, 5)
MATRIX = np.array([[620.0, 0, 325.0], [0, 618.0, 236.0], [0, 0, 1]])
DISTORTION = np.array([-0.18, 0.04, 0.0, 0.0, 0.0])


def board_view(turn: np.ndarray[tuple[int, ...], np.dtype[np.float64]], shift: tuple[float, float, float]) -> Bytes:
    """A board of 8 x 6 squares of 50 pixels of texture, side 1, as the distorted camera sees it."""
    squares = (np.indices((6, 8)).sum(axis=0) % 2 * 255).astype(np.uint8)
    texture = np.pad(np.kron(squares, np.ones((50, 50), np.uint8)), 50, constant_values=255)
    pixel = np.stack(np.meshgrid(np.arange(LENS_SIZE[0]), np.arange(LENS_SIZE[1])), -1).reshape(-1, 1, 2).astype(float)
    ray = cv2.undistortPoints(pixel, MATRIX, DISTORTION).reshape(-1, 2)
    rotation = cv2.Rodrigues(turn)[0]
    plane = np.linalg.inv(np.column_stack([rotation[:, :2], shift]))
    on_board = np.column_stack([ray, np.ones(len(ray))]) @ plane.T
    texel = (on_board[:, :2] / on_board[:, 2:] + [4, 3]) * 50 + 50 - 0.5
    maps = texel.reshape(*LENS_SIZE[::-1], 2).astype(np.float32)
    grey = cv2.remap(texture, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=140)
    return np.asarray(cv2.cvtColor(cv2.GaussianBlur(grey, (3, 3), 0.7), cv2.COLOR_GRAY2BGR), np.uint8)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng, views = np.random.default_rng(0), []
    for _ in range(18):
        shift = (*(rng.uniform(-1, 1, 2) * [2.5, 1.5]), rng.uniform(11, 17))
        views.append(board_view(rng.uniform(-0.55, 0.55, 3), shift))
    return write_at_rate(tmp_path_factory.mktemp("board") / "board.avi", views, 10.0, "FFV1")


def test_the_lens_comes_back(video: Path, tmp_path: Path, capsys: Captured) -> None:
    calibrate_lens(video, board="7,5", output=tmp_path / "lens.xml", every=1)
    assert "views off by 0." in capsys.readouterr().out
    lens = read_opencv_lens(tmp_path / "lens.xml")
    np.testing.assert_allclose(lens.matrix, MATRIX, atol=6)
    assert lens.distortion[0] == pytest.approx(-0.18, abs=0.03)


def test_a_wrong_board_is_named(video: Path, tmp_path: Path) -> None:
    said = "found 0 views of the whole board"
    refused(CalibrationError, said, calibrate_lens, video, board="9,6", output=tmp_path / "lens.xml", every=4)
    refused(ConfigError, "3 or more", calibrate_lens, video, board="2,5", output=tmp_path / "lens.xml")
