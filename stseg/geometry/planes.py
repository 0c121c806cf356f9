"""Homographies of planes parallel to the ground (Khan and Shah 2009, eq. 8; docs/how-it-works.md, Geometry).

A view is a ground homography `H` (ground metres -> pixels) and a scaled vertical vanishing point `a v`: what one metre
of height adds to the third column of `H`. With a projection matrix `[p1 p2 p3 p4]` they are `[p1 p2 p4]` and `p3`.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats

_E3 = np.array([0.0, 0.0, 1.0])


def plane_homography(ground: Floats, vertical: Floats, height: float) -> Floats:
    """Homography of the parallel plane at `height`: H(Z) = H + Z a v e3^T.

    Parameters
    ----------
    ground : float64 (3, 3)
        Ground homography, ground metres to pixels.
    vertical : float64 (3,)
        a v, in the scale of `ground`.
    height
        Z, metres.

    Returns
    -------
    float64 (3, 3)
    """
    return np.asarray(ground + height * np.outer(vertical, _E3))


def reduction(factor: int) -> Floats:
    """From pixels to those of an image reduced by a whole factor, each the mean of a square; float64 (3, 3)."""
    corner = (1 / factor - 1) / 2
    return np.array([[1 / factor, 0.0, corner], [0.0, 1 / factor, corner], [0.0, 0.0, 1.0]])


def vanishing_line(ground: Floats) -> Floats:
    """The ground's vanishing line in the image, l^T = e3^T H^-1, float64 (3,)."""
    return np.asarray(np.linalg.inv(ground)[2])
