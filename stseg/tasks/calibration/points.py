"""`stseg.calibrate_points`: a rig from measured points."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from stseg.arrays import Ints
from stseg.calibration.points.camera_models import Points
from stseg.calibration.points.point_fit import PointFit, fit_points
from stseg.calibration.points.radial_lens import MIN_POINTS
from stseg.engine.recordings import AnySource, camera_source
from stseg.errors import CalibrationError, ConfigError
from stseg.geometry import Grid, Rig
from stseg.io.calibrations.point_files import read_points
from stseg.io.calibrations.world_frame import UNITS, World, require_unit
from stseg.io.calibrations.xml_files import read_opencv_lens
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import write_rig

_LENS_NOISE = 9.0
"""Variance of a pixel from which on the lens is a suspect, square pixels."""
_UNCERTAIN_SHARE = 0.01
"""Share of a camera's ground that may be uncertain without a warning."""


@dataclass(frozen=True)
class PointCalibration:
    """A rig from points.

    Attributes
    ----------
    recording
        The rig and its streams, as they were written.
    lines
        For each camera the lines of its points in the file, int64 (n,).
    fits
        For each camera its fit: the error of every point, and the covariance.
    warnings
        One sentence for each badly determined camera.
    """

    recording: Recording
    lines: tuple[Ints, ...]
    fits: tuple[PointFit, ...]
    warnings: tuple[str, ...]


def calibrate_points(
    points: Path | str,
    output: Path | str,
    *,
    size: tuple[int, int],
    grid: Grid,
    frame_rate: float,
    sources: Mapping[str, AnySource] | str | Callable[[Sequence[str]], Sequence[AnySource]],
    scene: str | None = None,
    unit: Literal["mm", "cm", "m"] = "m",
    lens: str | None = None,
    overwrite: bool = False,
) -> PointCalibration:
    """Make a rig file from measured ground points and their pixels in each camera, as `stseg calibrate points` does.

    Parameters
    ----------
    points
        CSV with the columns camera,u,v,x,y and perhaps z: pixels (u to the right, v down), and places. Four of each
        camera lie on one plane: the ground, or a wall.
    output
        The rig file to write.
    size
        Width and height of the images, pixels.
    grid
        Ground cells and planes of the rig.
    frame_rate
        Frames per second of the recording.
    sources
        Source of every camera by its name; the path of all with `{name}` for the camera's name; or a function that
        gives the sources of cameras by their names.
    scene
        Name of the scene; None for the rig file's name.
    unit
        Unit of x, y and z.
    lens
        OpenCV XML with `camera_matrix` and `distortion_coefficients` of each camera, `{name}` standing for its name.
        Without it, a radial lens is fitted where eight points or more bear it out.
    overwrite
        Replace the rig file if it exists.

    Raises
    ------
    InputError
        Where the points do not determine a camera, or the rig file cannot be written.
    """
    output = Path(output)
    require_output(output, overwrite, Inputs([Path(points)]))
    tables, fits = read_points(Path(points)), list[PointFit]()
    for table in tables:
        if lens is not None and "{name}" not in lens:
            raise ConfigError("--lens", "", repr(lens), "a path with {name} in it")
        lens_file = None if lens is None else Path(lens.replace("{name}", table.camera))
        require_output(output, overwrite, Inputs([lens_file]))
        known_lens = None if lens_file is None else read_opencv_lens(lens_file)
        metres = table.place * UNITS[unit]
        try:
            fits.append(fit_points(table.camera, size, Points(table.pixel, metres[:, :2], metres[:, 2]), known_lens))
            require_unit(f"camera {table.camera}", "a camera", float(fits[-1].camera.centre[2]), World(unit))
        except CalibrationError as error:
            key = f"{error.place}, lines {table.line[0]} to {table.line[-1]}, {error.key}"
            raise CalibrationError(points, key, error.found, error.expected) from None
    names = [table.camera for table in tables]
    rig = Rig(scene or output.stem, frame_rate, grid, tuple(fit.camera for fit in fits))
    recording = Recording(output, rig, tuple(map(camera_source, _sources(sources, names))))
    write_rig(output, recording, overwrite)
    warnings = tuple(words for fit in fits for words in fit_warnings(fit, grid))
    return PointCalibration(recording, tuple(table.line for table in tables), tuple(fits), warnings)


def _sources(
    sources: Mapping[str, AnySource] | str | Callable[[Sequence[str]], Sequence[AnySource]], names: Sequence[str]
) -> Sequence[AnySource]:
    if isinstance(sources, str):
        return [sources.replace("{name}", name) for name in names]
    if callable(sources):
        return sources(names)
    if missing := [name for name in names if name not in sources]:
        raise ConfigError("sources", "", ", ".join(sources) or "none", f"one of camera {missing[0]} too")
    return [sources[name] for name in names]


def fit_warnings(fit: PointFit, grid: Grid) -> list[str]:
    """Warnings of a fit: pixels of another image, badly spread points, or too few to check."""
    deviation, words, size = fit.ground_deviation(grid), [], np.array(fit.camera.size)
    if (reach := fit.points.pixel.max(axis=0) + 0.5).max() > 0 and ((reach < size / 2).all() or (reach > size).any()):
        (u, v), (width, height) = reach.tolist(), size.tolist()
        words.append(
            f"{fit.camera.name}: its points reach to ({u:.0f}, {v:.0f}) in an image of {width} x {height} pixels: are "
            "they pixels of an image of another size?"
        )
    finite = deviation[np.isfinite(deviation)]
    share = float(np.mean(finite > grid.cell)) if len(finite) else 0.0
    if share > _UNCERTAIN_SHARE:
        row, column = np.unravel_index(int(np.nanargmax(deviation)), deviation.shape)
        x, y = grid.ground[row, column].tolist()
        words.append(
            f"{fit.camera.name}: its points are badly spread: {100 * share:.0f} % of the ground that it sees is known "
            f"worse than to a cell, and at ({x:.1f}, {y:.1f}) m only to {100 * deviation[row, column]:.0f} cm (one "
            "standard deviation): add points there"
        )
    if int(fit.inner.low.sum()) == 4:
        words.append(f"{fit.camera.name}: four points fit any camera: a fifth would show whether they are right")
    if fit.camera.lens is None and (fit.out.any() or fit.model.noise > _LENS_NOISE):
        words.append(
            f"{fit.camera.name}: points that do not fit may be right where the lens bends straight lines: give --lens, "
            f"or more points up to the image's corners (a lens is fitted from {MIN_POINTS} on)"
        )
    return words
