"""`stseg.align_rig`: a rig turned, shifted and scaled onto the ground of points, of a floor plan or of another rig."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from stseg.arrays import Floats, even_rows
from stseg.engine.recordings import recording_of
from stseg.errors import CalibrationError, ConfigError
from stseg.geometry import Rig
from stseg.geometry.ground_motion import GroundMotion, fit_motion
from stseg.io.calibrations.point_files import read_points
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_recording, write_rig
from stseg.io.recording.source_files import recording_files

_SAMPLES = 500
"""Most places that two rigs are compared at."""
_MIRRORED = 0.3
"""Residual of a mirrored fit over that of the fit, below which points are of a mirrored ground."""


@dataclass(frozen=True)
class AlignedPoint:
    """A point of known place."""

    camera: str
    line: int
    """Line of the file; 0 for a pixel of another rig."""
    place: tuple[float, float]
    """Where it is, metres."""
    off: float
    """Metres from there to where the aligned rig sees it."""


@dataclass(frozen=True)
class RigAlignment:
    """A rig on another ground.

    Attributes
    ----------
    recording
        The aligned rig and its streams, as they were written.
    motion
        The turn, shift and scale.
    points
        Every point with its residual.
    """

    recording: Recording
    motion: GroundMotion
    points: tuple[AlignedPoint, ...]

    @property
    def turn(self) -> float:
        """Counterclockwise turn of the ground, degrees."""
        return math.degrees(math.atan2(self.motion.factor.imag, self.motion.factor.real))

    @property
    def scale(self) -> float:
        """Factor of all lengths."""
        return abs(self.motion.factor)


def align_rig(
    rig: Path | str | Recording,
    reference: Path | str,
    output: Path | str,
    *,
    align: Literal["rigid", "similarity"] = "similarity",
    metres_per_pixel: float | None = None,
    overwrite: bool = False,
) -> RigAlignment:
    """Turn, shift and scale a rig onto a known ground, as `stseg calibrate align` does.

    Parameters
    ----------
    rig
        The rig file, or its recording.
    reference
        CSV with the columns camera,u,v,x,y: two or more ground pixels and their places in metres; or another rig file
        (.toml) with cameras of the same names.
    output
        The rig file to write.
    align
        Whether lengths are scaled, too (similarity).
    metres_per_pixel
        Where x and y are pixels of a floor plan's picture, y counted downwards: its scale. The origin becomes the
        picture's upper left corner, and y is counted upwards.
    overwrite
        Replace the rig file if it exists.

    Raises
    ------
    InputError
        Where a file cannot be read, a pixel does not show the ground, or the points do not fix the ground.
    """
    reference, output = Path(reference), Path(output)
    recording = recording_of(rig)
    require_output(output, overwrite, Inputs([reference, recording.path], recording_files(recording)))
    if reference.suffix.lower() == ".toml":
        found = _shared_places(recording.rig, read_recording(reference).rig, reference)
    else:
        found = _known_points(recording.rig, reference, metres_per_pixel)
    source, target = np.array([one[2] for one in found]), np.array([one[3] for one in found])
    motion = fit_motion(source, target, align == "similarity")
    away = np.linalg.norm(motion.of(source) - target, axis=1)
    _require_determined(reference, source, target, away)
    aligned = replace(recording, path=output, rig=motion.of_rig(recording.rig))
    write_rig(output, aligned, overwrite)
    points = tuple(
        AlignedPoint(camera, line, (float(x), float(y)), float(off))
        for (camera, line, _, (x, y)), off in zip(found, away, strict=True)
    )
    return RigAlignment(aligned, motion, points)


_Point = tuple[str, int, Floats, Floats]
"""Camera, line, the place by the rig, and the known place."""


def _known_points(rig: Rig, path: Path, metres_per_pixel: float | None) -> list[_Point]:
    cameras = {camera.name: camera for camera in rig.cameras}
    if metres_per_pixel is not None and not metres_per_pixel > 0:
        raise ConfigError("--metres-per-pixel", "", metres_per_pixel, "metres, above 0")
    unit = np.array([1.0, 1.0] if metres_per_pixel is None else [metres_per_pixel, -metres_per_pixel])
    found: list[_Point] = []
    for table in read_points(path):
        if table.camera not in cameras:
            raise CalibrationError(path, "camera", repr(table.camera), f"a camera of the rig: {', '.join(cameras)}")
        for line, pixel, place in zip(table.line.tolist(), table.pixel, table.place, strict=True):
            ground = cameras[table.camera].back_project(pixel, float(place[2]))
            if not np.isfinite(ground).all():
                raise CalibrationError(path, f"line {line}", "a pixel above the horizon", "one that shows the ground")
            found.append((table.camera, line, ground, place[:2] * unit))
    return found


def _shared_places(rig: Rig, other: Rig, path: Path) -> list[_Point]:
    """Places of the area that shared cameras show, and where the other rig sees them."""
    others, found = {camera.name: camera for camera in other.cameras}, list[_Point]()
    ground = rig.grid.ground[rig.grid.inside()]
    ground = ground[even_rows(len(ground), _SAMPLES)]
    for camera in (one for one in rig.cameras if one.name in others):
        place = others[camera.name].back_project(camera.project(ground, 0.0)[0])
        visible = camera.sees(ground, 0.0) & np.isfinite(place).all(axis=1)
        found += [(camera.name, 0, *pair) for pair in zip(ground[visible], place[visible], strict=True)]
    if not found:
        raise CalibrationError(path, "camera", ", ".join(others), "a camera of the same name, with a view of the area")
    return found


def _require_determined(path: Path, source: Floats, target: Floats, away: Floats) -> None:
    """Raise CalibrationError for points of one place, and for those of a mirrored ground."""
    if len(source) < 2 or not all(np.ptp(places, axis=0).any() for places in (source, target)):
        raise CalibrationError(path, "", f"{len(source)} points of one place", "two or more places")
    mirror = np.array([1.0, -1.0])
    motion = fit_motion(source, target * mirror, True)
    mirrored = np.linalg.norm(motion.of(source) - target * mirror, axis=1)
    if len(source) > 2 and np.linalg.norm(mirrored) < _MIRRORED * np.linalg.norm(away):
        found = f"a mirrored ground ({mirrored.max():.2f} m off, not {away.max():.2f}, where the sign of y changes)"
        raise CalibrationError(path, "y", found, "y counted upwards: change the sign of y")
