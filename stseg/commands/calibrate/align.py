"""`stseg calibrate align`: a rig on a known ground."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from stseg.commands.options import Overwrite
from stseg.commands.terminal.standard_error import warn
from stseg.tasks.calibration.alignment import align_rig

_DOUBTFUL_MEAN = 50.0
"""Mean distance of points from their places beyond which they are doubtful, centimetres."""


def align(
    rig: Annotated[Path, Parameter(name="RIG")],
    reference: Annotated[Path, Parameter(name="REFERENCE")],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="RIG.toml")],
    align: Literal["rigid", "similarity"] = "similarity",
    metres_per_pixel: float | None = None,
    overwrite: Overwrite = False,
) -> None:
    """Turn, shift and scale a rig onto a ground that you know, such as that of a building.

    REFERENCE is CSV with the columns camera,u,v,x,y: two or more ground pixels, and where they are in metres. Or it is
    another rig file (.toml) with cameras of the same names.

    ```
    stseg calibrate align room.toml known.csv -o placed.toml
    ```

    Parameters
    ----------
    rig
        The rig file.
    reference
        The points, or the other rig.
    output
        The rig file to write.
    align
        Whether lengths are scaled, too (similarity), or kept (rigid).
    metres_per_pixel
        Where x and y are pixels of a floor plan's picture, y counted downwards: its scale. The origin becomes the
        picture's upper left corner, and y is counted upwards.
    """
    found = align_rig(rig, reference, output, align=align, metres_per_pixel=metres_per_pixel, overwrite=overwrite)
    for point in found.points:
        if point.line:
            x, y = point.place
            print(f"{point.camera}, line {point.line}: ({x:.2f}, {y:.2f}) m, off by {100 * point.off:.1f} cm")
    off = [point.off for point in found.points]
    places = len({point.place for point in found.points})
    x, y = found.motion.shift.real, found.motion.shift.imag
    print(f"turned by {found.turn:.1f} degrees, scaled by {found.scale:.4f}, shifted by ({x:.2f}, {y:.2f}) m")
    mean = 100 * sum(off) / len(off)
    checked = "two places fit any rig: a third would show whether they are right" if places == 2 else ""
    print(f"{output}: {len(off)} points, off by {mean:.1f} cm on the average" + (f"; {checked}" if checked else ""))
    if mean > _DOUBTFUL_MEAN:
        warn([f"the points are off by {mean:.0f} cm on the average: is one of them wrong, or of another ground?"])
