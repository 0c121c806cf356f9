"""Calibrations of several cameras in one structured file: JSON, TOML or YAML."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.io.calibrations.foreign_camera import ForeignCamera, ForeignTable, camera_from_pose
from stseg.io.extras import load_extra
from stseg.io.toml import ANY, parse_toml
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_json, read_text
from stseg.io.untrusted.values import parse_whole

_LONGEST_YAML, _DEEPEST_YAML = 1 << 18, 50
"""Characters, and nested brackets: PyYAML needs a time that grows with the square of these."""


def read_krt_json(files: Sequence[Path]) -> list[ForeignCamera]:
    """Cameras by name, each with `K` (9 numbers), `RT` (12) and `imgSize`: `shelf` and `campus`.

    FormatError where a file is no such JSON.
    """
    return [camera for file in files for camera in _krt(_table(file, parse_json, "JSON"))]


def _krt(top: ForeignTable) -> Iterator[ForeignCamera]:
    for name in top.values:
        table = top.table(name)
        pose = table.matrix("RT", 3, 4)
        size = table.image_size("imgSize") if "imgSize" in table else None
        distortion = table.numbers("distCoeff", ANY) if "distCoeff" in table else np.zeros(5)
        yield camera_from_pose(top.file, name, size, table.matrix("K", 3, 3), pose[:, :3], pose[:, 3], distortion)


def read_pose_toml(files: Sequence[Path]) -> list[ForeignCamera]:
    """A table a camera with `matrix`, `distortions`, `rotation` (Rodrigues) and `translation`.

    aniposelib, FreeMoCap and Pose2Sim write them as `[cam_0]` beside `[metadata]`, caliscope as `[cameras.0]`.

    FormatError where a file is no such TOML.
    """
    return [camera for file in files for camera in _poses(_table(file, parse_toml, "TOML"))]


def _poses(top: ForeignTable) -> Iterator[ForeignCamera]:
    cameras = top.table("cameras") if isinstance(top.values.get("cameras"), dict) else top
    needed = {"matrix", "rotation", "translation"}
    named = cameras.values.items()
    tables = [cameras.table(name) for name, value in named if isinstance(value, dict) and needed <= set(value)]
    if not tables:
        raise top.error("", "no camera", "tables with matrix, rotation and translation")
    for table in tables:
        fisheye = bool(table.values.get("fisheye"))
        name = str(table.values.get("name", table.values.get("cam_id", table.place.rpartition(".")[2])))
        size = table.image_size("size") if "size" in table else None
        rotation = np.asarray(Rotation.from_rotvec(table.vector("rotation")).as_matrix())
        distortion = table.numbers("distortions", ANY) if "distortions" in table else np.zeros(5)
        translation, matrix = table.vector("translation"), table.matrix("matrix", 3, 3)
        yield camera_from_pose(top.file, name, size, matrix, rotation, translation, distortion, fisheye)


def read_nvidia_json(files: Sequence[Path]) -> list[ForeignCamera]:
    """NVIDIA's `calibration.json`: `sensors` with `cameraMatrix`, or with `intrinsicMatrix` and `extrinsicMatrix`.

    A sensor that has a homography alone does not say which way is up: give its `imageCoordinates` and
    `globalCoordinates` to `stseg calibrate points`.

    FormatError where a file is no such JSON, or a sensor has no camera matrix.
    """
    return [camera for file in files for camera in _sensors(_table(file, parse_json, "JSON"))]


def _sensors(top: ForeignTable) -> Iterator[ForeignCamera]:
    for sensor in top.tables("sensors", limits.CAMERAS):
        if "intrinsicMatrix" in sensor and "extrinsicMatrix" in sensor:
            pose = sensor.matrix("extrinsicMatrix", 3, 4)
            projection = sensor.matrix("intrinsicMatrix", 3, 3) @ pose
        elif "cameraMatrix" in sensor:
            projection = sensor.matrix("cameraMatrix", 3, 4)
        else:
            expected = "it, or its points for `stseg calibrate points`: a homography alone does not say what is up"
            raise sensor.error("cameraMatrix", "nothing", expected)
        yield ForeignCamera(top.file, sensor.text("id"), _frame_size(sensor), projection)


def _frame_size(sensor: ForeignTable) -> tuple[int, int] | None:
    """Width and height from the sensor's attributes, where it has them."""
    listed = sensor.values.get("attributes")
    rows = [row for row in listed if isinstance(row, dict)] if isinstance(listed, list) else []
    given = {name: row.get("value") for row in rows if isinstance(name := row.get("name"), str)}
    # Some files write numbers as text.
    sides = [parse_whole(str(given.get(key)), 1, limits.SIDE) for key in ("frameWidth", "frameHeight")]
    return (sides[0], sides[1]) if sides[0] is not None and sides[1] is not None else None


def read_kalibr_yaml(files: Sequence[Path]) -> list[ForeignCamera]:
    """Kalibr's camera chain: the world is the first camera's own, every other hangs on the one before it.

    FormatError where a file is no such chain, or a lens is none of `radtan`, `equidistant` and `none`; ConfigError
    where PyYAML is not installed.
    """
    load: Callable[[str], object] = load_extra("yaml", "kalibr").safe_load

    def load_flat(text: str) -> object:
        if len(text) > _LONGEST_YAML or _depth(text) > _DEEPEST_YAML:
            raise ValueError(f"more than {_LONGEST_YAML} characters, or {_DEEPEST_YAML} nested brackets")
        return load(text)

    return [camera for file in files for camera in _chain(_table(file, load_flat, "YAML"))]


def _depth(text: str) -> int:
    """Most brackets that are open at once."""
    steps = np.array([(c in "[{") - (c in "]}") for c in text], np.int64)
    return int(np.cumsum(steps).max(initial=0))


def _chain(top: ForeignTable) -> Iterator[ForeignCamera]:
    pose = np.eye(4)
    for index, name in enumerate(sorted(top.values, key=_number)):
        table = top.table(name)
        camera, lens = table.text("camera_model"), table.text("distortion_model")
        if camera != "pinhole" or lens not in ("radtan", "equidistant", "none"):
            expected = "pinhole-radtan or pinhole-equidistant: undistort its frames first"
            raise table.error("camera_model", f"{camera}-{lens}", expected)
        if index:
            pose = table.matrix("T_cn_cnm1", 4, 4) @ pose
        fu, fv, pu, pv = table.numbers("intrinsics", 4)
        matrix = np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]])
        distortion: Floats = np.zeros(4) if lens == "none" else table.numbers("distortion_coeffs", 4)
        size = table.image_size("resolution")
        fisheye = lens == "equidistant"
        yield camera_from_pose(top.file, name, size, matrix, pose[:3, :3], pose[:3, 3], distortion, fisheye)


def _number(name: str) -> tuple[int, str]:
    digits = name.removeprefix("cam")
    number = parse_whole(digits, 0, limits.CAMERAS)
    return (0, name) if number is None else (number, "")


def _table(file: Path, load: Callable[[str], object], language: str) -> ForeignTable:
    """The file's top table; what a language's own reader raises is a wrong format."""
    try:
        top = load(read_text(file))
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, f"a calibration in {language}") from error
    except Exception as error:  # json, tomllib and yaml have no error in common
        raise FormatError(file, "", f"what is not {language} ({str(error)[:120]})", language) from error
    if not isinstance(top, dict) or not top or not all(isinstance(name, str) for name in top):
        raise FormatError(file, "", "no table of cameras", f"one, in {language}")
    return ForeignTable(file, "", top)
