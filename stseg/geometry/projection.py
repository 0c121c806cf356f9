"""Projection of single points for kernels: what `Camera.project` does, one point at a time."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Floats
from stseg.geometry.lens import Lens
from stseg.kernels.accelerate import part


class LensTerms(NamedTuple):
    """A lens for kernels.

    Attributes
    ----------
    matrix : float64 (3, 3)
        Camera matrix, pixels.
    distortion : float64 (8,)
        k1, k2, p1, p2, k3, k4, k5, k6; all 0 for an ideal image.
    bends : bool
        Whether there is a lens.
    """

    matrix: Floats
    distortion: Floats
    bends: bool

    @classmethod
    def of(cls, lens: Lens | None) -> Self:
        """From a camera's lens."""
        distortion = np.zeros(8)
        if lens is None:
            return cls(np.eye(3), distortion, False)
        distortion[: len(lens.distortion)] = lens.distortion
        return cls(lens.matrix, distortion, True)


@part
def pixel_of(projection: Floats, lens: LensTerms, x: float, y: float, z: float) -> tuple[float, float]:
    """Pixel of a point in space, metres; nan behind the camera. The lens's fold is not asked."""
    p = projection
    away = p[2, 0] * x + p[2, 1] * y + p[2, 2] * z + p[2, 3]
    if not away > 0:
        return np.nan, np.nan
    u = (p[0, 0] * x + p[0, 1] * y + p[0, 2] * z + p[0, 3]) / away
    v = (p[1, 0] * x + p[1, 1] * y + p[1, 2] * z + p[1, 3]) / away
    return _bent(lens, u, v) if lens.bends else (u, v)


@part
def _bent(lens: LensTerms, u: float, v: float) -> tuple[float, float]:
    """Where the lens shows an undistorted pixel; see `Lens.distort`."""
    matrix, d = lens.matrix, lens.distortion
    k1, k2, p1, p2, k3, k4, k5, k6 = d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]
    y = (v - matrix[1, 2]) / matrix[1, 1]
    x = (u - matrix[0, 2] - matrix[0, 1] * y) / matrix[0, 0]
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    radial /= 1 + square * (k4 + square * (k5 + square * k6))
    bent_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    bent_y = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    bent_u = matrix[0, 0] * bent_x + matrix[0, 1] * bent_y + matrix[0, 2]
    return bent_u, matrix[1, 0] * bent_x + matrix[1, 1] * bent_y + matrix[1, 2]
