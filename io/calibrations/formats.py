"""The calibration formats: a new one is a reader, an entry here, and a line in docs/rigs.md."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.errors import CalibrationError, ConfigError, FormatError
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.matrices import read_pom, read_projection
from stseg.io.calibrations.structured import read_kalibr_yaml, read_krt_json, read_nvidia_json, read_pose_toml
from stseg.io.calibrations.world_frame import World
from stseg.io.calibrations.xml_files import read_opencv_xml, read_tsai_xml
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import EXPECTED, abbreviated, is_name


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Options of the command line for calibrations that lack them."""

    size: tuple[int, int] | None
    """Width and height of the images, pixels."""
    unit: str | None
    """Unit of length, as `World` takes it."""
    head: float
    """Height of POM's head plane, metres."""


Reader = Callable[[Sequence[Path], ImportOptions], list[ForeignCamera]]
"""Reads the files that belong together."""


@dataclass(frozen=True, slots=True)
class CalibrationFormat:
    """One format of calibrations: its reader, and what it is, for `stseg calibrate import --help`."""

    read: Reader
    about: str


def _without_options(read: Callable[[Sequence[Path]], list[ForeignCamera]]) -> Reader:
    return lambda files, _: read(files)


def _read_pom(files: Sequence[Path], options: ImportOptions) -> list[ForeignCamera]:
    if options.size is None or options.unit is None:
        missing = "--size" if options.size is None else "--unit"
        raise ConfigError(missing, "", "nothing", "the images' width,height and the side of the ground's cells")
    return read_pom(files, options.size, options.head / World(options.unit).metres)


_POSES = CalibrationFormat(_without_options(read_pose_toml), "its TOML, a table a camera")

FORMATS: Mapping[str, CalibrationFormat] = {
    "opencv": CalibrationFormat(
        _without_options(read_opencv_xml),
        "one FileStorage XML a camera, or two joined with a plus sign (`intrinsic.xml+extrinsic.xml`)",
    ),
    "matrix": CalibrationFormat(
        _without_options(read_projection), "one 3x4 projection matrix a camera, as .txt, .csv, .npy, .npz or .mat"
    ),
    "tsai": CalibrationFormat(_without_options(read_tsai_xml), "one XML a camera, as PETS 2009 has them"),
    "pom": CalibrationFormat(
        _read_pom,
        "EPFL's homographies, one text a camera with that of the ground and that of the heads, or "
        "`ground.txt+head.txt`; the unit is the side of the ground's cells",
    ),
    "krt": CalibrationFormat(_without_options(read_krt_json), "JSON with K, RT and imgSize of each camera"),
    "anipose": _POSES,
    "pose2sim": _POSES,
    "freemocap": _POSES,
    "caliscope": _POSES,
    "nvidia": CalibrationFormat(_without_options(read_nvidia_json), "calibration.json"),
    "kalibr": CalibrationFormat(_without_options(read_kalibr_yaml), "a camera chain in YAML (needs PyYAML)"),
}
"""By the name that `stseg calibrate import` takes."""


def read_cameras(format: str, files: Sequence[Path], options: ImportOptions) -> list[ForeignCamera]:
    """The cameras of files that belong together, in one of `FORMATS`.

    FormatError, CalibrationError, ConfigError where the files are not of that format, or their numbers make no cameras.
    """
    place = " + ".join(map(str, files))
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            cameras = FORMATS[format].read(files, options)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise CalibrationError(place, "", f"numbers that make no camera ({error})", "those of a camera") from error
    if len(cameras) > limits.CAMERAS:
        raise FormatError(place, "", f"{len(cameras)} cameras", f"at most {limits.CAMERAS}")
    for camera in cameras:
        if not (np.abs(camera.projection) <= limits.NUMBER).all():
            raise CalibrationError(place, f"camera {camera.name}".strip(), "numbers beyond any camera's", "usual ones")
        if camera.name and not is_name(camera.name):
            raise FormatError(place, "camera", abbreviated(camera.name), EXPECTED)
    return cameras


def help_text() -> str:
    """The formats as paragraphs of a command's help."""
    return "\n\n".join(f"    **{name}**: {form.about}." for name, form in FORMATS.items()).strip()
