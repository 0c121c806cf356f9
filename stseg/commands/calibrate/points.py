"""`stseg calibrate points`: a rig from measured points."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from stseg.calibration.points.point_fit import PointFit
from stseg.commands.calibrate.scene import SceneOptions, StreamOptions, size_of
from stseg.commands.terminal.standard_output import output_console
from stseg.tasks.calibration import points as points_task
from stseg.tasks.calibration.points import PointCalibration, fit_warnings

_SOURCES = {
    "points": "free vertical, from points above the ground",
    "lens": "camera matrix of the lens",
    "square pixels": "square pixels, axis in the middle of the image",
}


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
    found = points_task.calibrate_points(
        points,
        output,
        size=size_of(size),
        grid=scene.grid,
        frame_rate=scene.frame_rate,
        sources=(streams or StreamOptions()).of,
        scene=scene.scene,
        unit=unit,
        lens=lens,
        overwrite=overwrite,
    )
    _show(found)
    print(f"wrote {output}")


def _show(found: PointCalibration) -> None:
    """Print every point with its error, and a line and warnings of each camera."""
    console = output_console()
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("camera", "line", "x m", "y m", "z m", "off px", "off cm", ""):
        table.add_column(heading, justify="left" if heading in ("camera", "") else "right")
    for lines, fit in zip(found.lines, found.fits, strict=True):
        rows = zip(lines, fit.points.ground, fit.points.height, fit.off_pixel, fit.off_ground, fit.out, strict=True)
        for line, (x, y), z, pixel, ground, out in rows:
            places = (f"{x:.2f}", f"{y:.2f}", f"{z:.2f}", f"{pixel:.1f}", f"{100 * ground:.1f}")
            table.add_row(fit.camera.name, str(line), *places, "is it the right one?" if out else "")
    console.print(table)
    for fit in found.fits:
        console.print(_line(fit), soft_wrap=True)
        for words in fit_warnings(fit, found.recording.rig.grid):
            console.print(f"warning: {words}", style="yellow", soft_wrap=True)


def _line(fit: PointFit) -> str:
    x, y, z = fit.camera.centre
    used = fit.off_pixel[~fit.out]
    error = f"{np.sqrt(np.mean(used**2)):.1f} px (root mean square of {len(used)} points)"
    stands = f"{fit.camera.name}: at ({x:.2f}, {y:.2f}) m, {z:.2f} m above the ground"
    return f"{stands}; off by {error}; {_SOURCES[fit.vertical_from]}"
