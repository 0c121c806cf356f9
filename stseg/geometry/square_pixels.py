"""Vertical of a view from its ground homography alone, by square pixels and a central principal point."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError


def vertical_of_square_pixels(ground: Floats, size: tuple[int, int]) -> Floats:
    """The vertical a v of a camera with square pixels and a central principal point, in pixels a metre of height.

    The two ground axes are images of unit vectors at a right angle, which gives the focal length (Zhang, A flexible
    new technique for camera calibration, 2000, eqs 3 and 4); the vertical is then at right angles to both.

    Parameters
    ----------
    ground : float64 (3, 3)
        Homography from ground metres to pixels.
    size
        Width and height of the image, pixels.

    Returns
    -------
    float64 (3,)
        a v (see `stseg.geometry.planes`), in the scale of `ground`.

    Raises
    ------
    CalibrationError
        Where no such camera can have the homography, or it looks straight down and any focal length would do.
    """
    middle = np.eye(3)
    middle[:2, 2] = (np.asarray(size, float) - 1) / 2
    one, other = (np.linalg.inv(middle) @ np.asarray(ground, float))[:, :2].T
    inside = np.array([one[:2] @ other[:2], one[:2] @ one[:2] - other[:2] @ other[:2]])
    along = np.array([one[2] * other[2], one[2] ** 2 - other[2] ** 2])
    square = -float(inside @ inside) / float(along @ inside) if along @ inside else -1.0
    if not square > 0:
        raise CalibrationError("ground", "homography", "one that no camera with square pixels has", "a view at a slant")
    focal = np.diag([square**0.5, square**0.5, 1.0])
    up = np.cross(np.linalg.solve(focal, one), np.linalg.solve(focal, other))
    length = np.linalg.norm(np.linalg.solve(focal, np.stack([one, other], -1)), axis=0).mean()
    return np.asarray(middle @ focal @ up / length)
