"""Checks of measured points, and of the camera fitted to them."""

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError
from stseg.geometry import Camera

MIN_POINTS = 4
"""Least number of ground points of a homography."""
_COLLINEAR_RATIO = 0.02
"""Ratio of width to length of a point set below which it counts as collinear."""


def require_plane(name: str, ground: Floats, pixel: Floats) -> None:
    """Refuse points of a plane, (n, 2), that determine no homography to their pixels, (n, 2): CalibrationError."""
    place = f"camera {name}"
    if len(ground) < MIN_POINTS:
        found, expected = f"{len(ground)} on the ground (z = 0)", f"at least {MIN_POINTS}, there or on another plane"
        raise CalibrationError(place, "points", found, expected)
    for where, points in (("on the ground", ground), ("in the image", pixel)):
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if spread[1] <= _COLLINEAR_RATIO * spread[0]:
            raise CalibrationError(place, "points", f"points on one line {where}", "points spread over the ground")
        if all_but_one_on_line(points):
            found = f"points of which all but one lie on one line {where}"
            raise CalibrationError(place, "points", found, "four of which no three lie on a line")


def require_unmirrored(camera: Camera, projection: Floats) -> None:
    """Refuse a camera whose points lie before it, but whose matrix (3, 4) is left-handed, or below the ground.

    It would see the ground from behind, as a mirrored one does. CalibrationError.
    """
    if np.linalg.det(projection[:, :3]) < 0 or camera.centre[2] <= 0:
        raise CalibrationError(
            f"camera {camera.name}",
            "points",
            "a mirrored ground: left and right are exchanged between its points and the image",
            "x and y as seen from above, u to the right, v down: are two columns exchanged, or one counted backwards?",
        )


def all_but_one_on_line(points: Floats) -> bool:
    """Whether leaving out one point leaves a line, by the scatter of the others about their mean."""
    off, number = points - points.mean(axis=0), len(points)
    product = off[:, :, None] * off[:, None]
    scatter = product.sum(axis=0) - number / (number - 1) * product
    square = np.linalg.eigvalsh(scatter)
    return bool((square[:, -2] <= _COLLINEAR_RATIO**2 * square[:, -1]).any())
