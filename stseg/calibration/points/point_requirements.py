"""Checks of measured points, and of the camera fitted to them."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError
from stseg.geometry import Camera

MIN_POINTS = 4
"""Least number of ground points of a homography."""
_COLLINEAR_RATIO = 0.02
"""Ratio of width to length of a point set below which it counts as collinear."""


def require_ground(name: str, ground: Floats, pixel: Floats) -> None:
    """Refuse points that determine no homography.

    Parameters
    ----------
    name
        Name of the camera.
    ground, pixel : float64 (n, 2)
        Ground points, metres, and their pixels.

    Raises
    ------
    CalibrationError
        Where there are fewer than four, or they are collinear on the ground or in the image.
    """
    place = f"camera {name}"
    if len(ground) < MIN_POINTS:
        raise CalibrationError(place, "points", f"{len(ground)} on the ground (z = 0)", f"at least {MIN_POINTS}")
    for where, points in (("on the ground", ground), ("in the image", pixel)):
        if _on_line(points):
            raise CalibrationError(place, "points", f"points on one line {where}", "points spread over the ground")
        if all_but_one_on_line(points):
            found = f"points of which all but one lie on one line {where}"
            raise CalibrationError(place, "points", found, "four of which no three lie on a line")


def require_right_handed(name: str, ground: Floats, vertical: Floats) -> None:
    """Refuse a mirrored camera: its points lie before it, but homography and vertical are left-handed.

    Parameters
    ----------
    ground : float64 (3, 3)
        Homography, signed so that its points lie before the camera.
    vertical : float64 (3,)
        a v in its scale.

    Raises
    ------
    CalibrationError
    """
    if np.linalg.det(np.column_stack([ground[:, :2], vertical])) < 0:
        raise mirrored_points_error(name)


def require_upright(camera: Camera) -> None:
    """Refuse a camera below the ground: it sees the ground from behind, as a mirrored one does.

    Raises
    ------
    CalibrationError
    """
    if camera.centre[2] <= 0:
        raise mirrored_points_error(camera.name)


def mirrored_points_error(name: str) -> CalibrationError:
    """The error of a camera with mirrored points."""
    return CalibrationError(
        f"camera {name}",
        "points",
        "a mirrored ground: left and right are exchanged between its points and the image",
        "x and y as seen from above, u to the right, v down: are two columns exchanged, or one counted backwards?",
    )


def all_but_one_on_line(points: Floats) -> bool:
    """Whether leaving out one point leaves a line."""
    return any(_on_line(np.delete(points, k, axis=0)) for k in range(len(points)))


def _on_line(points: Floats) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= _COLLINEAR_RATIO * spread[0])
