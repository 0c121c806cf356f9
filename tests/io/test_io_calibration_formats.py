"""Every foreign format shows known ground points where its own model, written out here, does."""

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from checks import Captured, cases, data_path, refused
from reference_geometry import matrix_of, project_by_matrix, project_by_opencv
from scenes import rotation_towards
from scipy.io import savemat
from scipy.spatial.transform import Rotation
from strategies import BARREL, FISHEYE

from stseg import Camera, InputError, read_recording
from stseg.arrays import Floats
from stseg.commands.calibrate.app import app
from stseg.errors import CalibrationError, ConfigError, FormatError
from stseg.geometry.lens import LensModel
from stseg.io.calibrations.foreign_camera import ForeignCamera, camera_from_pose
from stseg.io.calibrations.matrices import read_pom, read_projection
from stseg.io.calibrations.structured import read_kalibr_yaml, read_krt_json, read_nvidia_json, read_pose_toml
from stseg.io.calibrations.world_frame import World, guess_unit, guess_up, median_height, require_median_height
from stseg.io.calibrations.xml_files import read_tsai_xml

SIZE = (640, 480)
MATRIX = np.array([[500.0, 0.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array(BARREL)
GROUND = np.stack(np.meshgrid(np.linspace(-1.5, 1.5, 5), np.linspace(-1.5, 1.5, 5)), -1).reshape(-1, 2)
HEIGHTS = np.linspace(0.0, 1.8, 25)
POINTS = np.column_stack([GROUND, HEIGHTS])


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of a test is that of its commands."""
    monkeypatch.chdir(tmp_path)


def pose(turn: float, metres: float = 1.0) -> tuple[Floats, Floats]:
    """Rodrigues vector and translation of a camera 4 m away and 2.2 m high that looks at the origin, Z up."""
    centre = np.array([4 * np.cos(turn), 4 * np.sin(turn), 2.2])
    rotation = rotation_towards(centre, [0.0, 0.0, 0.8])
    return np.asarray(Rotation.from_matrix(rotation).as_rotvec()), -rotation @ centre / metres


def expected(turn: float, distortion: Floats, model: LensModel = "pinhole") -> Floats:
    return project_by_opencv(MATRIX, distortion, *pose(turn), POINTS, model)


def pixels(foreign: ForeignCamera, world: World) -> Floats:
    return world.camera(foreign, foreign.name, foreign.size or SIZE).project(GROUND, HEIGHTS)[0]


def krt(path: Path) -> Path:
    cameras = {}
    for k in range(3):
        extrinsic = matrix_of(np.eye(3), *pose(k))
        cameras[str(k)] = {"K": MATRIX.ravel().tolist(), "RT": extrinsic.ravel().tolist(), "imgSize": list(SIZE)}
    path.write_text(json.dumps(cameras))
    return path


def pose_toml(path: Path, header: str, size: bool = True, lens: Floats = DISTORTION) -> Path:
    """Cameras in centimetres under `[cam_0]` or `[cameras.0]`."""
    lines = ["[metadata]", "adjusted = false", "error = 0.3", ""]
    for k in range(3):
        rotation, translation = pose(k, 0.01)
        lines += [f"[{header}{k}]", f'name = "view{k}"', *([f"size = {list(SIZE)}"] if size else [])]
        lines += [f"matrix = {MATRIX.tolist()}", f"distortions = {lens.tolist()}"]
        lines += [f"rotation = {rotation.tolist()}", f"translation = {translation.tolist()}"]
        lines += [f"fisheye = {str(len(lens) == 4).lower()}", ""]
    path.write_text("\n".join(lines))
    return path


def nvidia(path: Path) -> Path:
    sensors = []
    for k in range(3):
        matrix = matrix_of(MATRIX, *pose(k))
        sensor: dict[str, object] = {"type": "camera", "id": f"view{k}", "scaleFactor": 1.0}
        sensor["attributes"] = [{"name": "frameWidth", "value": "640"}, {"name": "frameHeight", "value": 480}]
        if k == 1:
            sensor |= {"intrinsicMatrix": MATRIX.tolist()}
            sensor |= {"extrinsicMatrix": matrix_of(np.eye(3), *pose(k)).tolist()}
        else:
            sensor["cameraMatrix"] = (matrix / matrix[2, 3]).tolist()
        sensors.append(sensor)
    path.write_text(json.dumps({"version": "1.0", "calibrationType": "cartesian", "sensors": sensors}))
    return path


class TestStructured:
    @pytest.mark.parametrize(
        ("read", "write", "distortion", "unit"),
        [
            (read_krt_json, krt, np.zeros(5), "m"),
            (read_pose_toml, lambda path: pose_toml(path, "cam_"), DISTORTION, "cm"),
            (read_pose_toml, lambda path: pose_toml(path, "cameras.", lens=np.array(FISHEYE)), np.array(FISHEYE), "cm"),
            (read_nvidia_json, nvidia, np.zeros(5), "m"),
        ],
    )
    def test_every_camera_shows_what_opencv_does(
        self,
        tmp_path: Path,
        read: Callable[[list[Path]], list[ForeignCamera]],
        write: Callable[[Path], Path],
        distortion: Floats,
        unit: str,
    ) -> None:
        cameras = read([write(tmp_path / "calibration")])
        assert [camera.size for camera in cameras] == [SIZE] * 3
        assert (guess_unit(cameras, guess_up(cameras)), guess_up(cameras)) == (unit, "+z")
        for k, camera in enumerate(cameras):
            want = expected(k, distortion, "fisheye" if len(distortion) == 4 else "pinhole")
            np.testing.assert_allclose(pixels(camera, World(unit)), want, rtol=0, atol=1e-6)

    def test_names_are_the_files(self, tmp_path: Path) -> None:
        assert [camera.name for camera in read_krt_json([krt(tmp_path / "c.json")])] == ["0", "1", "2"]
        cameras = read_pose_toml([pose_toml(tmp_path / "c", "cam_", False)])
        assert [camera.name for camera in cameras] == ["view0", "view1", "view2"]

    def test_a_chain_hangs_on_its_first_camera(self, tmp_path: Path) -> None:
        pytest.importorskip("yaml")
        poses = [np.vstack([matrix_of(np.eye(3), *pose(k)), [0, 0, 0, 1]]) for k in range(3)]
        lines = []
        for k in range(3):
            lines += [f"cam{k}:", "  camera_model: pinhole", "  distortion_model: radtan"]
            lines += [f"  distortion_coeffs: {list(BARREL[:4])}", "  intrinsics: [500.0, 510.0, 320.0, 240.0]"]
            lines += ["  resolution: [640, 480]", f"  rostopic: /cam{k}/image_raw"]
            if k:
                step = poses[k] @ np.linalg.inv(poses[k - 1])
                lines += ["  T_cn_cnm1:", *(f"  - {row}" for row in step.tolist())]
        path = tmp_path / "camchain.yaml"
        path.write_text("\n".join(lines))
        models: tuple[tuple[str, LensModel], ...] = (("radtan", "pinhole"), ("equidistant", "fisheye"))
        for word, model in models:
            path.write_text(path.read_text().replace("radtan", word))
            for k, camera in enumerate(read_kalibr_yaml([path])):
                in_world = ForeignCamera(path, "", SIZE, camera.projection @ poses[0], camera.lens)
                want = expected(k, np.array(BARREL[:4]), model)
                np.testing.assert_allclose(pixels(in_world, World()), want, rtol=0, atol=1e-6)
        path.write_text(path.read_text().replace("equidistant", "equi"))
        refused(FormatError, r"cam0.camera_model: found pinhole-equi, .*pinhole-equidistant", read_kalibr_yaml, [path])


def tsai_pixels(file: Path, points: Floats) -> Floats:
    """Tsai's model from the raw attributes, in millimetres; the distorted radius where it rises.

    nan near the radius at which the model turns round, which is steep there: only the corners of view 7 come so far.
    """
    root = ElementTree.parse(file).getroot()
    values = {name: float(value) for node in root for name, value in node.attrib.items()}
    rotation = Rotation.from_euler("xyz", [values[name] for name in ("rx", "ry", "rz")])
    seen = rotation.apply(points) + np.array([values["tx"], values["ty"], values["tz"]])
    plain = values["focal"] * seen[:, :2] / seen[:, 2:]
    turn, radius = 1 / np.sqrt(3 * max(-values["kappa1"], 1e-3)), np.hypot(*plain.T)
    distorted = np.linspace(0.0, turn, 1_000_000)
    shown = np.interp(radius, distorted * (1 + values["kappa1"] * distorted**2), distorted)
    u, v = plain.T / radius * np.where(shown < 0.85 * turn, shown, np.nan)
    return np.column_stack([values["sx"] * u / values["dpx"] + values["cx"], v / values["dpy"] + values["cy"]])


class TestTsai:
    @pytest.mark.parametrize("view", range(1, 9))
    def test_real_views_to_a_hundredth_of_a_pixel(self, view: int) -> None:
        file = data_path(f"pets2009/calibration/View_00{view}.xml")
        (foreign,) = read_tsai_xml([file])
        camera = World("mm").camera(foreign, foreign.name, foreign.size or SIZE)
        ground = np.stack(np.meshgrid(np.linspace(-40, 40, 101), np.linspace(-40, 40, 101)), -1).reshape(-1, 2)
        for height in (0.0, 1.8):
            pixel, ahead = camera.project(ground, height)
            seen = ahead & camera.inside(pixel)
            assert seen.sum() > 100
            points = 1000.0 * np.column_stack([ground[seen], np.full(int(seen.sum()), height)])
            want = tsai_pixels(file, points)
            known = np.isfinite(want).all(axis=1)
            assert known.mean() > (0.8 if view == 7 else 0.999)
            np.testing.assert_allclose(pixel[seen][known], want[known], rtol=0, atol=0.01)


class TestKrtData:
    def test_shelf(self) -> None:
        file = data_path("shelf/calibration.json")
        cameras = read_krt_json([file])
        assert (guess_unit(cameras, guess_up(cameras)), guess_up(cameras)) == ("m", "+z")
        for foreign, raw in zip(cameras, json.loads(file.read_text()).values(), strict=True):
            matrix = np.reshape(raw["K"], (3, 3)) @ np.reshape(raw["RT"], (3, 4))
            camera = World().camera(foreign, foreign.name, foreign.size or SIZE)
            pixel, ahead = camera.project(GROUND, HEIGHTS)
            assert ahead.sum() > 10
            want = project_by_matrix(matrix, POINTS)
            np.testing.assert_allclose(pixel[ahead], want[ahead], rtol=0, atol=1e-6)


def test_matrices_of_old_matlab(tmp_path: Path) -> None:
    savemat(tmp_path / "p.mat", {"P": matrix_of(MATRIX, *pose(1)), "note": "text"})
    (foreign,) = read_projection([tmp_path / "p.mat"])
    np.testing.assert_allclose(pixels(foreign, World()), expected(1, np.zeros(5)), rtol=0, atol=1e-6)


class TestPom:
    head, cell = 1.75, 0.25

    def files(self, folder: Path, turn: float) -> Path:
        """Homographies to cells of a grid whose rows count downwards: x = cell X, y = -cell Y."""
        matrix = matrix_of(MATRIX, *pose(turn)) @ np.diag([self.cell, -self.cell, 1.0, 1.0])
        low = np.linalg.inv(matrix[:, [0, 1, 3]])
        high = np.linalg.inv(np.column_stack([matrix[:, :2], matrix[:, 3] + self.head * matrix[:, 2]]))
        lines = ["Camera 0", "ground plane homography", *(str(row) for row in (-3.0 * low).tolist())]
        lines += ["head plane homography", *(str(row) for row in high.tolist())]
        path = folder / f"c{turn:.0f}.txt"
        path.write_text("\n".join(lines))
        return path

    def test_two_planes_make_a_camera_and_mirrors_are_named(self, tmp_path: Path, capsys: Captured) -> None:
        (foreign,) = read_pom([self.files(tmp_path, 2)], SIZE, self.head / self.cell)
        camera = World(str(self.cell), mirrored=True).camera(foreign, "c", SIZE)
        pixel, ahead = camera.project(GROUND, HEIGHTS)
        assert ahead.all()
        np.testing.assert_allclose(pixel, expected(2, np.zeros(5)), rtol=0, atol=1e-6)
        files = [self.files(tmp_path, turn).name for turn in (0, 2)]
        scene = ("--size=640,480", "--unit=0.25", "--up=+z", "-o=r.toml")
        refused(CalibrationError, r"handedness: found a mirrored world.*--mirrored", run, "pom", *files, *scene)
        run("pom", *files, *scene, "--mirrored")
        assert "calibrated in units of 0.25 m (given), +z up (given), mirrored" in capsys.readouterr().out
        camera = read_recording("r.toml").rig.cameras[0]
        np.testing.assert_allclose(camera.centre, [4.0, 0.0, 2.2], atol=1e-6)


def turned(up: str, unit: float) -> list[ForeignCamera]:
    """The ring of cameras in a world with another axis up and another unit."""
    world = World(str(unit), up)  # type: ignore[arg-type]
    to_metres = np.linalg.inv(world.from_metres)
    return [ForeignCamera(Path("c"), str(k), SIZE, matrix_of(MATRIX, *pose(k)) @ to_metres) for k in range(4)]


class TestGuesses:
    @pytest.mark.parametrize("up", ["+z", "-z", "+y", "-y", "+x", "-x"])
    @pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0)])
    def test_unit_and_axis_are_found(self, up: str, unit: str, metres: float) -> None:
        cameras = turned(up, metres)
        assert guess_up(cameras) == up and guess_unit(cameras, guess_up(cameras)) == unit
        world = World(unit, guess_up(cameras))
        assert median_height(cameras, world) == pytest.approx(2.2)
        for k, camera in enumerate(cameras):
            np.testing.assert_allclose(pixels(camera, world), expected(k, np.zeros(5)), rtol=0, atol=1e-6)

    @pytest.mark.parametrize(("given", "true", "hint"), [("m", 0.001, "mm"), ("mm", 1.0, "m"), ("m", 0.01, "cm")])
    def test_a_wrong_unit_is_named(self, given: str, true: float, hint: str) -> None:
        said = rf"--unit {given}: .* are its lengths in {hint}\?"
        refused(CalibrationError, said, require_median_height, turned("+z", true), World(given))

    def test_a_mirrored_world_is_named(self) -> None:
        mirror = np.diag([1.0, -1.0, 1.0, 1.0])
        cameras = [ForeignCamera(c.file, c.name, SIZE, c.projection @ mirror) for c in turned("+z", 1.0)]
        refused(CalibrationError, r"cameras below the ground .*--mirrored", guess_unit, cameras, guess_up(cameras))
        rotation = Rotation.from_rotvec(pose(0)[0]).as_matrix() @ mirror[:3, :3]
        read = (Path("c"), "a", SIZE, MATRIX, np.asarray(rotation), pose(0)[1], np.zeros(5))
        refused(CalibrationError, r"rotation: found a mirror", camera_from_pose, *read)

    def test_a_mirrored_world_takes_one_try(self, tmp_path: Path, capsys: Captured) -> None:
        """A ground whose y counts downwards; the area lies to one side of its x axis."""
        for k, camera in enumerate(turned("+z", 1.0)):
            np.savetxt(tmp_path / f"c{k}.txt", camera.projection @ np.diag([1.0, -1.0, 1.0, 1.0]))
        files = [f"c{k}.txt" for k in range(4)]
        refused(CalibrationError, r"--mirrored", run, "matrix", *files, "--size=640,480", "-o=r.toml")
        wrong, said = "--area=-12,13,-9,16", r"--area: .* --area=-12,-16,-9,-13: --mirrored reverses y"
        refused(ConfigError, said, run, "matrix", files[1], "--size=640,480", "-o=r.toml", "--mirrored", area=wrong)
        for up in ((), ("--up=z",), ("--up", "+z")):
            run("matrix", *files, "--size=640,480", "-o=r.toml", "--mirrored", *up, "--overwrite")
        assert "+z up (given), mirrored" in capsys.readouterr().out
        for k, found in enumerate(read_recording("r.toml").rig.cameras):
            np.testing.assert_allclose(found.project(GROUND, HEIGHTS)[0], expected(k, np.zeros(5)), rtol=0, atol=1e-6)

    @pytest.mark.parametrize("unit", ["km", "-1", "nan", "0"])
    def test_no_unit(self, unit: str) -> None:
        refused(ConfigError, r"--unit: found", World, unit)


def run(*tokens: str, area: str = "--area=-1.5,-1.5,1.5,1.5") -> None:
    options = (area, "--frame-rate=5", "--source-pattern={name}.avi")
    app(["import", *tokens, *options], exit_on_error=False, print_error=False, result_action="return_value")


class TestCommand:
    @cases()
    def test_says_what_to_mend(self, tmp_path: Path, option: str, complaint: str) -> None:
        pose_toml(tmp_path / "c.toml", "cam_")
        refused(InputError, complaint, run, "caliscope", "c.toml", "-o=r.toml", option)

    def test_a_size_alone_is_asked_for(self, tmp_path: Path, capsys: Captured) -> None:
        pose_toml(tmp_path / "c.toml", "cam_", size=False)
        refused(ConfigError, r"--size: found nothing, .*c.toml does not say it", run, "pose2sim", "c.toml", "-o=r.toml")
        pose_toml(tmp_path / "c.toml", "cam_")
        run("anipose", "c.toml", "-o=r.toml")
        cameras: tuple[Camera, ...] = read_recording("r.toml").rig.cameras
        assert [camera.name for camera in cameras] == ["view0", "view1", "view2"]
        np.testing.assert_allclose(cameras[1].project(GROUND, HEIGHTS)[0], expected(1, DISTORTION), rtol=0, atol=1e-6)
        assert "calibrated in cm (guessed: --unit), +z up (guessed: --up)" in capsys.readouterr().out
