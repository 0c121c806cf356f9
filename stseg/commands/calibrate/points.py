"""`stseg calibrate points`: a rig from measured points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from stseg.calibration.points.point_fit import PointFit, Points, fit_points
from stseg.calibration.points.point_requirements import require_height
from stseg.commands.calibrate.scene import SceneOptions, StreamOptions, size_of
from stseg.errors import ConfigError
from stseg.geometry import Grid, Lens, Rig
from stseg.io.calibrations.opencv_xml import read_opencv_lens
from stseg.io.calibrations.point_files import PointTable, read_points
from stseg.io.calibrations.world_frame import UNITS
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import write_rig

_SOURCES = {
    "points": "free vertical, from points above the ground",
    "lens": "camera matrix of the lens",
    "square pixels": "square pixels, axis in the middle of the image",
}
_LITTLE = 0.01
"""Share of a camera's ground that may be uncertain without a warning."""


def calibrate_points(
    points: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="RIG.toml")],
    size: Annotated[str, Parameter(metavar="W,H")],
    scene: SceneOptions,
    streams: StreamOptions | None = None,
    unit: Literal["mm", "cm", "m"] = "m",
    lens: Annotated[str | None, Parameter(metavar="PATTERN")] = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Make a rig file from measured ground points and their pixels in each camera.

    POINTS is a CSV file with the columns camera,u,v,x,y and perhaps z: pixels (u to the right, v down), and places on
    the ground. Each camera needs four or more points on the ground, well spread over what it sees; six or more show
    how well they agree. Cameras are taken for ones with square pixels around the image's middle, or of the matrix of
    --lens, unless two or more points with z above 0, such as the top of a door, show that they are not.

    ```
    stseg calibrate points points.csv -o room.toml --size 640,480 --area=-3,-3,3,3 --frame-rate 25 \\
        --source-pattern '{name}.avi'
    ```

    Parameters
    ----------
    points
        The CSV file.
    output
        The rig file to write.
    size
        Width and height of the images, pixels.
    unit
        Unit of x, y and z.
    lens
        OpenCV XML with `camera_matrix` and `distortion_coefficients` of each camera, `{name}` standing for its name.
    overwrite
        Replace the rig file if it exists.
    """
    require_new(output, overwrite)
    width, height = size_of(size)
    tables, grid = read_points(points), scene.grid
    fits = []
    for table in tables:
        fits.append(_fit(table, (width, height), unit, None if lens is None else _lens(lens, table.camera)))
        require_height(fits[-1].camera, unit, UNITS)
    names = [table.camera for table in tables]
    rig = Rig(scene.scene or output.stem, scene.frame_rate, grid, tuple(fit.camera for fit in fits))
    write_rig(output, Recording(output, rig, (streams or StreamOptions()).of(names)))
    _show(tables, fits, grid)
    print(f"wrote {output}")


def _fit(table: PointTable, size: tuple[int, int], unit: str, lens: Lens | None) -> PointFit:
    metres = table.place * UNITS[unit]
    return fit_points(table.camera, size, Points(table.pixel, metres[:, :2], metres[:, 2]), lens)


def _lens(pattern: str, name: str) -> Lens:
    if "{name}" not in pattern:
        raise ConfigError("--lens", "", repr(pattern), "a path with {name} in it")
    return read_opencv_lens(Path(pattern.replace("{name}", name)))


def _show(tables: Sequence[PointTable], fits: Sequence[PointFit], grid: Grid) -> None:
    """Print every point with its error, and a line and warnings of each camera."""
    console = Console(highlight=False, markup=False)
    shown = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("camera", "line", "x m", "y m", "z m", "off px", "off cm", ""):
        shown.add_column(heading, justify="left" if heading in ("camera", "") else "right")
    for table, fit in zip(tables, fits, strict=True):
        rows = zip(
            table.line, fit.points.ground, fit.points.height, fit.off_pixel, fit.off_ground, fit.out, strict=True
        )
        for line, (x, y), z, pixel, ground, out in rows:
            places = (f"{x:.2f}", f"{y:.2f}", f"{z:.2f}", f"{pixel:.1f}", f"{100 * ground:.1f}")
            shown.add_row(table.camera, str(line), *places, "is it the right one?" if out else "")
    console.print(shown)
    for fit in fits:
        console.print(_line(fit), soft_wrap=True)
        for words in warnings(fit, grid):
            console.print(f"warning: {words}", style="yellow", soft_wrap=True)


def _line(fit: PointFit) -> str:
    x, y, z = fit.camera.centre
    used = fit.off_pixel[~fit.out]
    error = f"{np.sqrt(np.mean(used**2)):.1f} px (root mean square of {len(used)} points)"
    stands = f"{fit.camera.name}: at ({x:.2f}, {y:.2f}) m, {z:.2f} m above the ground"
    return f"{stands}; off by {error}; {_SOURCES[fit.vertical_from]}"


def warnings(fit: PointFit, grid: Grid) -> list[str]:
    """Warnings of a fit: badly spread points, or too few to check."""
    deviation, words = fit.ground_deviation(grid), []
    known = deviation[np.isfinite(deviation)]
    share = float(np.mean(known > grid.cell)) if len(known) else 0.0
    if share > _LITTLE:
        row, column = np.unravel_index(int(np.nanargmax(deviation)), deviation.shape)
        x, y = grid.ground[row, column].tolist()
        words.append(
            f"{fit.camera.name}: its points are badly spread: {100 * share:.0f} % of the ground that it sees is known "
            f"worse than to a cell, and at ({x:.1f}, {y:.1f}) m only to {100 * deviation[row, column]:.0f} cm (one "
            "standard deviation): add points there"
        )
    if int(fit.points.low.sum()) == 4:
        words.append(f"{fit.camera.name}: four points fit any camera: a fifth would show whether they are right")
    return words
