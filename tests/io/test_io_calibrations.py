from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from checks import Captured, cases, data_path, drawn, numbers, refused
from cyclopts import CycloptsError
from hypothesis import strategies as st
from reference_geometry import matrix_of, project_by_matrix, project_by_opencv
from strategies import BARREL, Pose, poses

from stseg import Camera, errors, read_recording
from stseg.arrays import Floats
from stseg.commands.calibrate.app import app
from stseg.commands.calibrate.importing import _named
from stseg.errors import CalibrationError, ConfigError, FormatError
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.matrices import read_projection
from stseg.io.calibrations.world_frame import Up, World
from stseg.io.calibrations.xml_files import read_opencv_xml

SIZE = (640, 480)
MATRIX = np.array([[500.0, 0.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]])
# A camera 2 m above the origin that looks along y and down, in millimetres with Z pointing down, as `uu4`'s.
ROTATION = np.array([-1.2, 0.0, 0.0])
TRANSLATION = 2000.0 * np.array([0.0, np.sin(1.2), np.cos(1.2)])
GROUND = np.array([[0.3, 1.0], [-0.4, 1.5], [0.0, 2.0], [0.8, 3.0]])
HEIGHTS = np.array([0.0, 0.5, 1.1, 1.8])


def xml(**nodes: Floats | str) -> str:
    """What OpenCV's FileStorage writes, nodes of matrices with a <data>, texts as they are."""

    def node(name: str, value: Floats | str) -> str:
        if isinstance(value, str):
            return f"<{name}>{value}</{name}>"
        words = " ".join(map(repr, value.ravel().tolist()))
        return f'<{name} type_id="opencv-matrix">\n<dt>d</dt><data>\n {words}</data></{name}>\n'

    body = "".join(node(name, value) for name, value in nodes.items())
    return f'<?xml version="1.0"?>\n<opencv_storage>\n{body}</opencv_storage>\n'


def whole(distortion: Floats | None = None) -> str:
    return xml(
        camera_matrix=MATRIX,
        distortion_coefficients=np.array(BARREL) if distortion is None else distortion,
        rotation_vectors=ROTATION,
        translation_vectors=TRANSLATION,
    )


def opencv_camera(text: str, folder: Path, world: World | None = None) -> Camera:
    file = folder / "config.xml"
    file.write_text(text)
    return camera_of(read_opencv_xml([file]), world or World("mm", "-z"))


def camera_of(read: list[ForeignCamera], world: World, size: tuple[int, int] = SIZE) -> Camera:
    (foreign,) = read
    return world.camera(foreign, "cam", size)


def in_world(ground: Floats, heights: Floats, per_metre: float, up: float) -> Floats:
    """Points (n, 3) of the calibration's world: X = x, Y = -y, Z = -z where up is -1."""
    return np.column_stack([ground[:, 0], up * ground[:, 1], up * heights]) * per_metre


class TestWorld:
    @pytest.mark.parametrize(("unit", "per_metre"), [("mm", 1000.0), ("cm", 100.0), ("m", 1.0)])
    @pytest.mark.parametrize(("up", "sign"), [("+z", 1.0), ("-z", -1.0)])
    def test_points_keep_their_pixels(self, unit: str, per_metre: float, up: Up, sign: float) -> None:
        points = in_world(GROUND, HEIGHTS, per_metre, sign)
        homogeneous = np.column_stack([GROUND, HEIGHTS, np.ones(4)]) @ World(unit, up).from_metres.T
        np.testing.assert_allclose(homogeneous, np.column_stack([points, np.ones(4)]), rtol=1e-15)
        assert np.linalg.det(World(unit, up).from_metres) > 0, "a mirrored world"

    @drawn(100, poses(), st.sampled_from(("mm", "cm", "m")), st.sampled_from(("+z", "-z")), numbers(-5.0, 5.0))
    def test_scale_of_the_matrix_is_depth_in_metres(self, pose: Pose, unit: str, up: Up, factor: float) -> None:
        world = World(unit, up)
        scale = factor if abs(factor) > 0.1 else 1.0
        foreign = pose.projection @ np.linalg.inv(world.from_metres) * scale
        camera = world.camera(ForeignCamera(Path("p.txt"), "", None, foreign), "cam", SIZE)
        np.testing.assert_allclose(camera.projection, pose.projection, rtol=1e-9, atol=1e-9)

    def test_no_camera_names_the_file(self) -> None:
        foreign = ForeignCamera(Path("p.txt"), "", None, np.zeros((3, 4)))
        refused(CalibrationError, r"p.txt: projection matrix: found a singular", World().camera, foreign, "cam", SIZE)


class TestOpencvXml:
    @pytest.mark.parametrize(
        "distortion", [BARREL, BARREL[:4], (*BARREL, 0.02, -0.01, 0.03), (*BARREL, 0.0, 0.0, 0.0), (0.0,) * 5]
    )
    def test_projects_as_opencv_does(self, tmp_path: Path, distortion: tuple[float, ...]) -> None:
        camera = opencv_camera(whole(np.array(distortion)), tmp_path)
        points = in_world(GROUND, HEIGHTS, 1000.0, -1.0)
        expected = project_by_opencv(MATRIX, np.array(distortion), ROTATION, TRANSLATION, points)
        pixel, _ = camera.project(GROUND, HEIGHTS)
        np.testing.assert_allclose(pixel, expected, rtol=0, atol=1e-6)
        assert (camera.lens is None) == (not any(distortion))

    def test_two_files_make_one_camera(self, tmp_path: Path) -> None:
        intrinsic, extrinsic = tmp_path / "intr.xml", tmp_path / "extr.xml"
        intrinsic.write_text(xml(camera_matrix=MATRIX, distortion_coefficients=np.array(BARREL)))
        extrinsic.write_text(xml(rvec="\n -1.2 0. -0e0\n", tvec=" ".join(map(repr, TRANSLATION.tolist()))))
        camera = camera_of(read_opencv_xml([intrinsic, extrinsic]), World("mm", "-z"))
        np.testing.assert_array_equal(camera.projection, opencv_camera(whole(), tmp_path).projection)

    @pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
    def test_no_document_type_no_entities(self, tmp_path: Path, encoding: str) -> None:
        bomb = '<!DOCTYPE x [<!ENTITY a "500.0"><!ENTITY b "&a;&a;&a;">]>'
        file = tmp_path / "config.xml"
        file.write_bytes(whole().replace("<opencv_storage>", f"{bomb}<opencv_storage>").encode(encoding))
        said = r"config.xml: found (a document type declaration|bytes that are no UTF-8)"
        refused(FormatError, said, read_opencv_xml, [file])


class TestProjection:
    matrix = matrix_of(MATRIX, ROTATION, TRANSLATION)

    def write(self, file: Path) -> Path:
        match file.suffix:
            case ".txt":
                np.savetxt(file, self.matrix, fmt="%.17g")
            case ".csv":
                np.savetxt(file, self.matrix, fmt="%.17g", delimiter=",")
            case ".npy":
                np.save(file, self.matrix)
            case ".npz":
                np.savez(file, P=self.matrix, K=MATRIX)
            case ".mat":
                with h5py.File(file, "w", userblock_size=512) as group:
                    group["P"] = self.matrix.T
                    group["K"] = MATRIX
        return file

    @pytest.mark.parametrize("suffix", [".txt", ".csv", ".npy", ".npz", ".mat"])
    def test_every_format_holds_the_same_camera(self, tmp_path: Path, suffix: str) -> None:
        camera = camera_of(read_projection([self.write(tmp_path / f"cam{suffix}")]), World("mm", "-z"))
        expected = project_by_matrix(self.matrix, in_world(GROUND, HEIGHTS, 1000.0, -1.0))
        np.testing.assert_allclose(camera.project(GROUND, HEIGHTS)[0], expected, rtol=1e-9)

    @pytest.mark.parametrize("suffix", [".txt", ".csv", ".npy", ".npz", ".mat"])
    @pytest.mark.parametrize("content", [b"", b"1 2 3", b"\xff\xfe\x00", b"PK\x03\x04 cut short", b"\x89HDF\r\n\x1a\n"])
    def test_refuses_other_contents(self, tmp_path: Path, suffix: str, content: bytes) -> None:
        file = tmp_path / f"cam{suffix}"
        file.write_bytes(content)
        refused(FormatError, rf"cam{suffix}: found .* expected one 3x4 projection matrix", read_projection, [file])

    def test_refuses_what_is_not_one_matrix(self, tmp_path: Path) -> None:
        for suffix in (".txt", ".npy", ".npz", ".mat"):
            refused(FormatError, r"No such file", read_projection, [tmp_path / f"nowhere{suffix}"])
        np.savez(tmp_path / "two.npz", a=self.matrix, b=self.matrix)
        refused(FormatError, r"2 arrays of that shape \(a, b\)", read_projection, [tmp_path / "two.npz"])
        np.save(tmp_path / "nan.npy", self.matrix * np.nan)
        refused(FormatError, r"numbers that are not finite", read_projection, [tmp_path / "nan.npy"])
        np.save(tmp_path / "objects.npy", self.matrix.astype(object))
        refused(FormatError, r"cannot be read", read_projection, [tmp_path / "objects.npy"])
        refused(FormatError, r"the suffix '.yml', expected one of .txt", read_projection, [tmp_path / "cam.yml"])


class TestRealCalibrations:
    """The projections of the raw numbers, by OpenCV, to a hundredth of a pixel or better."""

    @cases()
    def test_cameras_project_as_their_numbers_do(
        self, name: str, patterns: list[str], cameras: int, axes: Any, size: Any, area: Any, heights: Any, least: int
    ) -> None:
        world = World(*axes)
        files_of_cameras = list(zip(*(sorted(data_path(name).glob(pattern)) for pattern in patterns), strict=True))
        assert len(files_of_cameras) == cameras
        grid = np.stack(np.meshgrid(*(np.linspace(*side) for side in area)), -1).reshape(-1, 2)
        for files in files_of_cameras:
            camera = camera_of((read_projection if name == "cmc" else read_opencv_xml)(list(files)), world, size)
            assert (camera.lens is None) == (world.unit != "mm")
            assert heights[0] < camera.centre[2] < heights[1], "as high as the cameras hang"
            for height in (0.0, 1.8):
                points = in_world(grid, np.full(len(grid), height), 1 / world.metres, -1.0 if world.up == "-z" else 1.0)
                expected = raw_pixels(files, points)
                pixel, seen = camera.project(grid, height)
                assert seen.sum() > least
                np.testing.assert_allclose(pixel[seen], expected[seen], rtol=0, atol=1e-6)


def raw_pixels(files: tuple[Path, ...], points: Floats) -> Floats:
    """By a matrix of MATLAB, or by `cv2.projectPoints` on numbers picked out of the files by hand."""
    if files[0].suffix == ".mat":
        with h5py.File(files[0]) as group:
            (stored,) = (dataset[()] for dataset in group.values())
        return project_by_matrix(stored.T, points)
    text = "".join(file.read_text() for file in files)

    def node(name: str) -> Floats:
        inner = text.split(f"<{name}", 1)[1].split(">", 1)[1].split(f"</{name}>", 1)[0]
        return np.array(inner.rsplit("<data>", 1)[-1].replace("</data>", "").split(), float)

    matrix, distortion = node("camera_matrix").reshape(3, 3), node("distortion_coefficients")
    pair = ("rvec", "tvec") if "<rvec>" in text else ("rotation_vectors", "translation_vectors")
    rotation, translation = map(node, pair)
    return project_by_opencv(matrix, distortion, rotation, translation, points)


SCENE = ("--size=640,480", "--unit=mm", "--up=-z", "--frame-rate=5", "--area=-1,0.5,1,3")
SOURCE = ("--source-pattern={name}.avi",)


def calibrate(*tokens: object) -> None:
    """`stseg calibrate import` with these tokens; of an option given twice, the last counts."""
    last = {str(token).split("=")[0]: str(token) for token in tokens}
    app(["import", *last.values()], exit_on_error=False, print_error=False, result_action="return_value")


@pytest.fixture
def calibrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two cameras' files, relative to the working folder, as a shell's glob gives them."""
    monkeypatch.chdir(tmp_path)
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "config.xml").write_text(whole())
    return ["left/config.xml", "right/config.xml"]


class TestCommand:
    def test_one_line_makes_a_rig(self, calibrations: list[str], capsys: Captured) -> None:
        masks = ("--source-pattern={name}/fg.avi", "--source-kind=masks", "--background={name}/empty.avi")
        calibrate("opencv", *calibrations, *SCENE, *masks, "-o=room.toml", "--planes=4", "--cell=0.25")
        recording = read_recording("room.toml")
        rig, grid = recording.rig, recording.rig.grid
        assert (rig.name, rig.frame_rate, [camera.name for camera in rig.cameras]) == ("room", 5.0, ["left", "right"])
        assert (grid.x, grid.y, grid.cell, grid.planes, grid.top) == ((-1.0, 1.0), (0.5, 3.0), 0.25, 4, 1.8)
        assert [streams.source.path for streams in recording.sources] == [Path("left/fg.avi"), Path("right/fg.avi")]
        assert recording.sources[0].source.kind == "masks" and recording.sources[1].background is not None
        line = "left: at (0.00, 0.00) m, 2.00 m above the ground"
        printed = capsys.readouterr().out.replace("-0.00", "0.00").splitlines()
        world = "calibrated in mm (given), -z up (given)"
        assert printed == [world, line, line.replace("left", "right"), "wrote room.toml"]

    def test_pairs_names_sources_polygon(self, calibrations: list[str]) -> None:
        Path("in.xml").write_text(xml(camera_matrix=MATRIX, distortion_coefficients=np.zeros(5)))
        Path("ex.xml").write_text(xml(rvec=ROTATION, tvec=TRANSLATION))
        kept = ("--first-frame=1", "--score=0.3", "--appearance={name}.npy")
        boxes = ("--sources=a.txt,b.txt", "--source-kind=boxes", *kept)
        scene = (*SCENE, "--polygon=-1,0.5,1,0.5,1,3", "--scene=hall", "--names=a,b")
        calibrate("opencv", "in.xml+ex.xml", calibrations[0], *scene, *boxes, "-o=room.toml")
        recording = read_recording("room.toml")
        assert recording.rig.name == "hall"
        assert [camera.name for camera in recording.rig.cameras] == ["a", "b"]
        assert recording.rig.grid.polygon is not None and len(recording.rig.grid.polygon) == 3
        assert recording.sources[1].source.path == Path("b.txt")
        assert recording.sources[1].source.first_frame == 1 and recording.sources[1].source.least_score == 0.3
        assert recording.sources[1].source.appearance == Path("b.npy")

    def test_matrices_and_which_files(self, calibrations: list[str]) -> None:
        np.savetxt("p.txt", matrix_of(MATRIX, ROTATION, TRANSLATION), fmt="%.17g")
        calibrate("matrix", "p.txt", *SCENE, *SOURCE, "-o=matrix.toml")
        calibrate("opencv", calibrations[0], *SCENE, *SOURCE, "-o=opencv.toml")
        by_matrix, by_opencv = (read_recording(f"{name}.toml").rig.cameras[0] for name in ("matrix", "opencv"))
        np.testing.assert_allclose(by_matrix.projection, by_opencv.projection, rtol=1e-12, atol=1e-9)
        assert by_matrix.name == "p"
        options = (*SCENE, *SOURCE, "-o=room.toml")
        refused(ConfigError, r"found nothing, expected one calibration a camera", calibrate, "opencv", *options)
        refused(CycloptsError, r"--up", calibrate, "opencv", calibrations[0], *options, "--up=w")
        refused(FormatError, r"nowhere.xml: found No such file", calibrate, "opencv", "nowhere.xml", *options)
        Path("left/left").mkdir()
        Path("left/left/config.xml").write_text(whole())
        files = (calibrations[0], "left/left/config.xml")
        refused(ConfigError, r"--names: found files and folders that share", calibrate, "opencv", *files, *options)
        twice = read_opencv_xml([Path(files[0])]) * 2
        refused(ConfigError, "found 2 cameras in 1 files, not all with a name", _named, twice, files[:1], None)

    def test_an_own_rig_is_replaced_and_options_stand_apart(self, calibrations: list[str]) -> None:
        calibrate("opencv", calibrations[0], *SCENE, *SOURCE, "-o=room.toml")
        apart = [word for option in (*SCENE, *SOURCE) for word in option.split("=")]
        tokens = ["import", "opencv", *calibrations, *apart, "-o", "room.toml", "--overwrite"]
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        assert read_recording("room.toml").rig.grid.x == (-1.0, 1.0)
        assert len(read_recording("room.toml").rig.cameras) == 2

    @cases()
    def test_says_what_to_mend(self, calibrations: list[str], tokens: str, kind: str, complaint: str) -> None:
        options = (*SCENE, *SOURCE, "-o=room.toml", *tokens.split())
        refused(getattr(errors, kind), complaint, calibrate, "opencv", *calibrations, *options)
        assert not Path("room.toml").exists()

    def test_a_camera_below_ground_is_told(self, calibrations: list[str], capsys: Captured) -> None:
        calibrate("opencv", calibrations[0], *SCENE, *SOURCE, "-o=r.toml", "--up=+z", "--area=-1,-3,1,-0.5")
        assert "2.00 m below the ground: is --up right?" in capsys.readouterr().out
