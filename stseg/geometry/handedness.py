"""Mirrored calibrations: detection of a left-handed world frame."""

from __future__ import annotations

import numpy as np

from stseg.geometry.camera import Camera
from stseg.geometry.fits import homogeneous
from stseg.geometry.grid import Grid
from stseg.geometry.planes import vanishing_line


def is_mirrored(camera: Camera, grid: Grid) -> bool:
    """Whether the camera's image would show the area, below its horizon, were it not behind the camera.

    A camera's matrix is signed for a right-handed world. In a mirrored one the same matrix has the other sign, and all
    that it shows lies behind it. (Above its horizon a camera sees nothing of the ground in any case.)
    """
    ground = grid.ground[grid.inside()]
    for height in grid.heights:
        plane = camera.plane(float(height))
        image = homogeneous(ground) @ plane.T
        finite = np.abs(image[:, 2]) > 1e-12
        pixel = image[finite, :2] / image[finite, 2:]
        inside = camera.inside(pixel)
        a, b, c = vanishing_line(plane)
        below = pixel[:, 1] > -(a * pixel[:, 0] + c) / b if b else np.ones(len(pixel), bool)
        if (inside & (image[finite, 2] > 0)).any():
            return False
        if (inside & below).any():
            return True
    return False
