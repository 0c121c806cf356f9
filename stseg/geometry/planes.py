"""Homographies of parallel planes, and the homology between two of them (METHODS 1; KS09 eq. 8).

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


def homology(ground: Floats, vertical: Floats, height: float) -> Floats:
    """The planar homology in the image that lifts the ground to `height`: H(Z) = (I + Z a v l^T) H, float64 (3, 3)."""
    return np.asarray(np.eye(3) + height * np.outer(vertical, vanishing_line(ground)))


def inverse_homology(ground: Floats, vertical: Floats, height: float) -> Floats:
    """Its inverse in closed form: I - Z a v l^T / (1 + Z a l^T v), float64 (3, 3)."""
    line = vanishing_line(ground)
    return np.asarray(np.eye(3) - height * np.outer(vertical, line) / (1.0 + height * float(line @ vertical)))


def view_to_view(
    ground_from: Floats, vertical_from: Floats, ground_to: Floats, vertical_to: Floats, height: float
) -> Floats:
    """Homography from one image to another through the plane at `height`: H_i(Z) H_j(Z)^-1, float64 (3, 3)."""
    inverse = np.linalg.inv(ground_from) @ inverse_homology(ground_from, vertical_from, height)
    return np.asarray(plane_homography(ground_to, vertical_to, height) @ inverse)
