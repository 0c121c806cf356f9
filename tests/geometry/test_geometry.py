"""Cameras, grids and rigs; reduction of images."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import cases, compiled_only, drawn, numbers, refused
from hypothesis import assume, example
from hypothesis import strategies as st
from recordings import track
from reference_geometry import project_by_matrix, project_by_opencv
from scenes import looking
from strategies import BARREL, FISHEYE, LENSES, Pose, cameras, grids, poses, rigs

from stseg import Camera, Grid, Lens, Recording, Rig, Source, read_recording, read_run
from stseg.arrays import Floats
from stseg.commands.main import main
from stseg.errors import CalibrationError
from stseg.geometry.grid import inside_polygon
from stseg.geometry.lens import LensModel
from stseg.geometry.rig import greatest_reduction
from stseg.geometry.sampling import LensTerms, pixel_of
from stseg.io.recording.frames import open_frames, read_background
from stseg.io.recording.recording import CameraSource

MATRIX = np.array([[492.3, 0.0, 341.1], [0.0, 494.7, 225.1], [0.0, 0.0, 1.0]])
LENS, WIDE = Lens(MATRIX, np.array(BARREL)), Lens(MATRIX, np.array(FISHEYE), "fisheye")
LEVEL = np.array([[500.0, 320.0, 0.0, 0.0], [0.0, 240.0, -500.0, 1000.0], [0.0, 1.0, 0.0, 0.0]])
"""A camera 2 m above the origin that looks along y, the horizon at v = 240."""
# Within sight of every camera that looks at the origin: at least 1.5 m in front of it and below it.
HEIGHTS = numbers(0.0, 1.2)
GROUNDS = st.lists(st.tuples(numbers(-1.2, 1.2), numbers(-1.2, 1.2)), min_size=1, max_size=8).map(np.array)


def pixels_under(matrix: Floats, points: Floats) -> Floats:
    return np.asarray(cv2.perspectiveTransform(points[None], matrix)[0])


def in_space(ground: Floats, height: float) -> Floats:
    return np.column_stack([ground, np.full(len(ground), height)])


def straight_down(height: float = 3.0, lens: Lens | None = None) -> Camera:
    """A camera above the origin, image u along x, v along -y."""
    rotation = np.diag([1.0, -1.0, -1.0])
    projection = MATRIX @ np.column_stack([rotation, [0.0, 0.0, height]])
    return Camera.from_projection("down", (644, 486), projection, lens)


@drawn(100, cameras(), GROUNDS, HEIGHTS)
def test_single_points_are_projected_alike(camera: Camera, ground: Floats, height: float) -> None:
    expected, ahead = camera.project(ground, height)
    lens = LensTerms.of(camera.lens)
    assert ahead.all()
    for (x, y), pixel in zip(ground, expected, strict=True):
        np.testing.assert_allclose(pixel_of(camera.projection, lens, x, y, height), pixel, rtol=1e-9, atol=1e-9)


def test_a_rational_lens_distorts_points_one_by_one() -> None:
    lens = Lens(MATRIX, np.array([0.4, 0.1, 0.002, -0.003, 0.01, 0.6, 0.2, 0.02]))
    camera = Camera.from_projection("cam", (640, 480), LEVEL, lens)
    expected, _ = camera.project(np.array([0.4, 3.0]), 1.0)
    np.testing.assert_allclose(pixel_of(LEVEL, LensTerms.of(lens), 0.4, 3.0, 1.0), expected, rtol=1e-9)
    assert np.isnan(pixel_of(LEVEL, LensTerms.of(lens), 0.4, -3.0, 1.0)).all()


class TestPlanes:
    @drawn(100, poses(), GROUNDS, HEIGHTS)
    def test_project_as_the_matrix_does(self, pose: Pose, ground: Floats, height: float) -> None:
        expected = project_by_matrix(pose.projection, in_space(ground, height))
        camera = Camera.from_projection("cam", (640, 480), pose.projection)
        np.testing.assert_allclose(pixels_under(camera.plane(height), ground), expected, rtol=1e-9, atol=1e-6)
        pixel, seen = camera.project(ground, height)
        assert seen.all()
        np.testing.assert_allclose(pixel, expected, rtol=1e-9, atol=1e-6)

    @drawn(100, cameras(lenses=False), HEIGHTS)
    def test_the_third_column_and_the_homology_of_the_image_are_one(self, camera: Camera, height: float) -> None:
        """Khan and Shah 2009, eq. 8: H(Z) = (I + Z a v l^T) H with the vanishing line l of the ground."""
        lift = np.eye(3) + height * np.outer(camera.vertical, np.linalg.inv(camera.ground)[2])
        plane = camera.plane(height)
        np.testing.assert_allclose(lift @ camera.ground, plane, rtol=0, atol=1e-9 * np.abs(plane).max())


class TestCamera:
    @drawn(100, cameras(), GROUNDS, HEIGHTS)
    def test_back_projection_returns(self, camera: Camera, ground: Floats, height: float) -> None:
        pixel, seen = camera.project(ground, height)
        assert seen.all()
        np.testing.assert_allclose(camera.back_project(pixel, height), ground, rtol=0, atol=1e-8)

    @drawn(100, poses(), numbers(-9.0, 9.0).filter(lambda scale: abs(scale) > 1e-3), GROUNDS)
    def test_scale_and_sign_of_the_homography_mean_nothing(self, pose: Pose, scale: float, ground: Floats) -> None:
        plain = Camera.from_projection("cam", (640, 480), pose.projection)
        scaled = Camera("cam", (640, 480), plain.ground * scale, plain.vertical * scale)
        expected, seen = plain.project(ground, 1.0)
        pixel, seen_too = scaled.project(ground, 1.0)
        assert seen.all() and seen_too.all()
        np.testing.assert_allclose(pixel, expected, rtol=1e-9, atol=1e-9)

    @drawn(100, poses())
    def test_centre(self, pose: Pose) -> None:
        camera = Camera.from_projection("cam", (640, 480), pose.projection * -2.0)
        np.testing.assert_allclose(camera.centre, -pose.rotation.T @ pose.translation, rtol=0, atol=1e-9)

    @drawn(100, poses(), numbers(0.1, 50.0), numbers(-3.0, 3.0), numbers(-3.0, 3.0))
    def test_points_behind_are_unseen(self, pose: Pose, depth: float, right: float, down: float) -> None:
        point = pose.rotation.T @ (np.array([right, down, -depth]) - pose.translation)
        for lens in (None, Lens(pose.matrix, np.array(BARREL))):
            camera = Camera.from_projection("cam", (640, 480), pose.projection, lens)
            pixel, seen = camera.project(point[:2], point[2])
            assert not seen and not camera.inside(pixel)

    def test_the_horizon_heights_and_edges_of_the_image(self) -> None:
        camera = Camera.from_projection("cam", (640, 480), LEVEL)
        ground = camera.back_project(np.array([[320.0, 300.0], [320.0, 200.0]]))
        assert np.isfinite(ground[0]).all() and np.isnan(ground[1]).all()
        pixel, seen = straight_down().project(np.zeros((4, 1, 2)), np.array([0.0, 1.0]))
        assert pixel.shape == (4, 2, 2) and seen.shape == (4, 2)
        camera = straight_down()
        corners = np.array([[-0.5, -0.5], [643.4, 485.4], [643.5, 0.0], [0.0, 485.5], [-0.6, 0.0]])
        assert camera.inside(corners).tolist() == [True, True, False, False, False]

    @cases()
    def test_refuses_what_is_no_view(self, ground: list[list[float]], vertical: list[float], key: str) -> None:
        with pytest.raises(CalibrationError, match="camera cam") as caught:
            Camera("cam", (640, 480), np.array(ground, float), np.array(vertical, float))
        assert caught.value.key == key

    def test_units_do_not_make_a_homography_singular(self) -> None:
        plain = straight_down()
        tiny = Camera("cam", (640, 480), plain.ground @ np.diag([1e-6, 1e-6, 1.0]), plain.vertical * 1e-6)
        pixel, _ = tiny.project(np.array([5e5, -5e5]), 0.0)
        np.testing.assert_allclose(pixel, plain.project(np.array([0.5, -0.5]), 0.0)[0])


class TestLens:
    @drawn(100, poses(), GROUNDS, HEIGHTS, st.sampled_from(LENSES))
    def test_distorts_as_opencv_does(
        self, pose: Pose, ground: Floats, height: float, chosen: tuple[tuple[float, ...], LensModel]
    ) -> None:
        lens = Lens(pose.matrix, np.array(chosen[0]), chosen[1])
        camera = Camera.from_projection("cam", (640, 480), pose.projection, lens)
        vector, _ = cv2.Rodrigues(pose.rotation)
        expected = project_by_opencv(
            pose.matrix, lens.distortion, np.asarray(vector), pose.translation, in_space(ground, height), lens.model
        )
        np.testing.assert_allclose(camera.project(ground, height)[0], expected, rtol=0, atol=1e-6)

    @drawn(100, numbers(0.0, 0.99), numbers(0.0, 6.3), st.sampled_from((LENS, WIDE)))
    def test_undistorts_everything_before_the_fold(self, share: float, angle: float, lens: Lens) -> None:
        radius = share * min(lens.fold, 20.0)  # 87 degrees off the axis
        ideal = MATRIX[:2, 2] + radius * np.array([np.cos(angle), np.sin(angle)]) * np.diag(MATRIX)[:2]
        pixel, unfolded = lens.distort(ideal)
        assert unfolded
        np.testing.assert_allclose(lens.undistort(pixel), ideal, rtol=1e-7, atol=1e-6)

    def test_fold_is_where_the_radius_turns_round(self) -> None:
        k1, k2, _, _, k3 = BARREL
        radius = np.linspace(0.0, 2.0, 200_001)
        barrel = radius * (1 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6)
        rational = barrel / (1 + 0.3 * radius**2 - 0.1 * radius**4 + 0.02 * radius**6)
        for bent, more in ((barrel, ()), (rational, (0.3, -0.1, 0.02))):
            turn = radius[np.argmax(np.diff(bent) < 0)]
            assert Lens(MATRIX, np.array([*BARREL, *more])).fold == pytest.approx(turn, abs=2e-5)
        assert Lens(MATRIX, np.array([0.1, 0.2])).fold == WIDE.fold == np.inf
        assert Lens(MATRIX, np.array([-1 / 3]), "fisheye").fold == pytest.approx(np.tan(1.0))
        assert Lens(MATRIX, np.zeros(0)).fold == Lens(MATRIX, np.array([0.1, 1e-320])).fold == np.inf

    def test_points_that_fold_back_and_unreached_corners(self) -> None:
        camera = straight_down(lens=LENS)
        far = np.array([4.8, 0.0])
        pixel, seen = camera.project(far, 0.0)
        assert camera.inside(pixel), "the polynomial brings it back"
        assert not seen
        assert camera.project(np.array([1.0, 0.0]), 0.0)[1]
        corner, middle = LENS.undistort(np.array([[0.0, 0.0], [300.0, 200.0]]))
        assert np.isnan(corner).all() and np.isfinite(middle).all()
        assert np.isnan(straight_down(lens=LENS).back_project(np.array([0.0, 0.0]))).all()


class TestGrid:
    @drawn(100, grids())
    def test_cells_and_ground_agree(self, grid: Grid) -> None:
        planes, rows, columns = grid.shape
        assert grid.ground.shape == (rows, columns, 2)
        cell = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1)
        np.testing.assert_allclose(grid.cell_of(grid.ground), cell, atol=1e-9)
        assert len(grid.heights) == planes and grid.inside().shape == (rows, columns)

    def test_first_centre_is_half_a_cell_inside_the_corner(self) -> None:
        grid = Grid((-2.5, 2.5), (-4.5, 1.5), cell=0.1, top=1.8, planes=10)
        assert grid.shape == (10, 60, 50)
        np.testing.assert_allclose(grid.ground[0, 0], (-2.45, -4.45))
        np.testing.assert_allclose(grid.cell_of(np.array([-2.5, -4.5])), (-0.5, -0.5))
        np.testing.assert_allclose(grid.heights[[0, 1, -1]], (0.0, 0.2, 1.8))

    @drawn(100, numbers(-1.0, 3.0), numbers(-1.0, 3.0))
    @example(0.5, 1.5)
    def test_polygon_may_be_hollow(self, x: float, y: float) -> None:
        ell = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
        expected = (0 < x < 2 and 0 < y < 1) or (0 < x < 1 and 0 < y < 2)
        assume(all(min(abs(x - edge), abs(y - edge)) > 1e-9 for edge in (0, 1, 2)))
        for polygon in (ell, ell[::-1], np.roll(ell, 2, axis=0)):
            assert bool(inside_polygon(np.array([x, y]), polygon)) == expected


class TestRig:
    @compiled_only
    @drawn(100, rigs())
    def test_that_watches_its_area(self, rig: Rig) -> None:
        rig.require_coverage()

    def test_cameras_that_look_away_are_named_but_at_upper_planes(self) -> None:
        away = Grid((50.0, 51.0), (0.0, 1.0), cell=0.5)
        said = r"camera down: ground: found a view that sees nothing"
        refused(CalibrationError, said, Rig("hall", 5.0, away, (straight_down(),)).require_coverage)
        camera = Camera.from_projection("cam", (640, 480), LEVEL)
        near = Grid((-0.5, 0.5), (1.0, 2.0), cell=0.5, top=1.8, planes=4)
        pixel, seen = camera.project(near.ground, 0.0)
        assert seen.all() and not camera.inside(pixel).any(), "its feet are below the image"
        Rig("hall", 5.0, near, (camera,)).require_coverage()


GRID = Grid((-2.0, 2.0), (-2.0, 2.0))


@pytest.mark.parametrize("distortion", [None, BARREL])
@drawn(100, x=numbers(-2, 2), y=numbers(-2, 2), height=numbers(0, 2), factor=st.integers(1, 6))
def test_a_reduced_view_shows_each_point_in_its_square(
    distortion: tuple[float, ...] | None, x: float, y: float, height: float, factor: int
) -> None:
    camera = looking("west", (-4.5, -3.0, 2.6), size=(640, 480), focal=500.0, distortion=distortion)
    small = camera.reduced(factor)
    assert small.size == (640 // factor, 480 // factor)
    (pixel, ahead), (reduced, still) = (view.project(np.array([x, y]), height) for view in (camera, small))
    assert ahead == still
    np.testing.assert_allclose(factor * (reduced + 0.5) - 0.5, pixel, atol=1e-6)


def test_people_stay_as_large_as_is_asked() -> None:
    camera = looking("west", (-4.5, -3.0, 2.6), size=(1280, 960), focal=1000.0)
    feet, head = (camera.project(GRID.ground, height)[0] for height in (0.0, 1.7))
    whole = camera.inside(feet) & camera.inside(head)
    spanned = float(np.median(np.hypot(*(feet - head)[whole].T)))
    for rows in (20.0, 60.0, 300.0):
        factor = greatest_reduction(camera, GRID, rows)
        assert spanned / factor >= rows or factor == 1
        assert spanned / (factor + 1) < rows
    away = looking("away", (-4.5, -3.0, 2.6), target=(-9.0, -6.0, 1.0))
    assert greatest_reduction(away, GRID, 1.0) == 1


def test_frames_are_means_of_squares_and_masks_stay(tmp_path: Path) -> None:
    cameras = tuple(looking(name, (-4.5, -3.0, 2.6), size=(65, 48), focal=52.0) for name in ("colour", "masks"))
    picture = np.random.default_rng(1).integers(0, 256, (48, 65, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "0.png"), picture)
    (tmp_path / "masks").mkdir()
    cv2.imwrite(str(tmp_path / "masks" / "0.png"), picture[:, :, 0])
    sources = (
        CameraSource(Source("images", tmp_path / "0.png"), background=Source("images", tmp_path / "0.png")),
        CameraSource(Source("masks", tmp_path / "masks")),
    )
    recording = Recording(tmp_path / "rig.toml", Rig("hall", 5.0, GRID, cameras), sources).reduced(6.0)
    assert recording.factors == (2, 1)
    assert [camera.size for camera in recording.reduced_rig.cameras] == [(32, 24), (65, 48)]
    expected = picture[:, :64].reshape(24, 2, 32, 2, 3).mean((1, 3))
    with open_frames(recording) as moments:
        colour, masks = next(moments).views
    for shown in (colour, *read_background(recording, 0)):
        assert isinstance(shown, np.ndarray)
        np.testing.assert_allclose(shown, expected, atol=0.51)
    assert isinstance(masks, np.ndarray)
    np.testing.assert_array_equal(masks, picture[:, :, 0])


@pytest.mark.slow
@compiled_only
def test_boxes_of_a_run_are_in_the_pixels_of_the_images(tmp_path: Path) -> None:
    film = ["simulate", str(tmp_path / "film"), "--scene", "demo", "--seconds", "1.5", "--size", "320,240"]
    assert main(film) == 0
    rig, rows = tmp_path / "film" / "rig.toml", 25.0
    assert min(read_recording(rig).reduced(rows).factors) > 1
    boxes = []
    for name, asked in (("whole.h5", 10000.0), ("reduced.h5", rows)):
        assert track(rig, tmp_path / name, options=("--set", f"foreground.body_rows={asked}")) == 0
        boxes.append(read_run(tmp_path / name).boxes)
    whole, reduced = boxes
    last = [table[table["frame"] == table["frame"].max()] for table in boxes]
    assert len(whole) == pytest.approx(len(reduced), rel=0.1)
    for side in ("left", "top", "width", "height"):
        one, other = (np.median(table[side]) for table in last)
        assert one == pytest.approx(other, abs=0.05 * 320)


@drawn(100, numbers(-3.0, 0.0), numbers(0.03, 0.5), st.integers(1, 40))
def test_a_point_between_two_cells_touches_both(start: float, cell: float, columns: int) -> None:
    grid = Grid((start, start + 41 * cell), (0.0, 2 * cell), cell=cell, top=1.0, planes=1)
    point = (start + columns * cell, cell)
    touched = grid.touching((*point, *point))
    assert touched[0].sum() == 2 and touched[0, columns - 1 : columns + 1].all()
