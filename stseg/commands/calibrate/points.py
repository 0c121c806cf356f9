"""`stseg calibrate points`: a rig from measured points."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from stseg.calibration.points.point_fit import PointFit
from stseg.commands.calibrate.scene import SceneOptions, StreamOptions, size_of
from stseg.commands.options import Overwrite
from stseg.commands.terminal.standard_output import output_console, table_of
from stseg.tasks.calibration import points as points_task
from stseg.tasks.calibration.points import PointCalibration

_SOURCES = {
    "points": "free vertical, from points off the plane of the others",
    "lens": "camera matrix of the lens",
    "square pixels": "square pixels, axis in the middle of the image",
    "radial lens": "square pixels, axis in the middle of the image, and a lens that the points bear out: k1",
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
    overwrite: Overwrite = False,
) -> None:
    """Make a rig file from measured ground points and their pixels in each camera.

    POINTS is a CSV file with the columns camera,u,v,x,y and perhaps z: pixels (u to the right, v down), and places.
    Each camera needs four or more points on the ground, or on another plane such as a wall, well spread over what it
    sees; six or more show how well they agree. Cameras are taken for ones with square pixels around the image's middle,
    or of the matrix of --lens, unless two or more points off that plane, such as the top of a door, show that they are
    not. From eight points on, a lens that bends straight lines is found.

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
        Without it, a radial lens is fitted where eight points or more bear it out.
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
    rows = []
    for lines, fit in zip(found.lines, found.fits, strict=True):
        numbers = np.column_stack([fit.points.place, fit.off_pixel, 100 * fit.off_ground]).tolist()
        for line, (x, y, z, pixel, ground), out in zip(lines, numbers, fit.out, strict=True):
            places = (f"{x:.2f}", f"{y:.2f}", f"{z:.2f}", f"{pixel:.1f}", f"{ground:.1f}")
            rows.append((fit.camera.name, str(line), *places, "is it the right one?" if out else ""))
    console.print(table_of(("camera", "line", "x m", "y m", "z m", "off px", "off cm", ""), rows))
    for fit in found.fits:
        console.print(_line(fit), soft_wrap=True)
    for words in found.warnings:
        console.print(f"warning: {words}", style="yellow", soft_wrap=True)


def _line(fit: PointFit) -> str:
    x, y, z = fit.camera.centre
    used = fit.off_pixel[~fit.out]
    error = f"{np.sqrt(np.mean(used**2)):.1f} px (root mean square of {len(used)} points)"
    stands = f"{fit.camera.name}: at ({x:.2f}, {y:.2f}) m, {z:.2f} m above the ground"
    k1 = ""
    if fit.vertical_from == "radial lens":
        k1 = f" {fit.model.unknowns[7]:.2f} ± {np.sqrt(fit.model.covariance[7, 7]):.2f}"
    return f"{stands}; off by {error}; {_SOURCES[fit.vertical_from]}{k1}"
