"""Fitting a view to points: ground homography by DLT, vertical from points above ground or from square pixels."""

import numpy as np

from stseg.arrays import Floats

_SHORTEST, _LONGEST = 0.2, 10.0
"""Focal lengths in widths of the image between which those of lenses lie (from 136 down to 6 degrees)."""


def fit_homography(ground: Floats, pixel: Floats) -> Floats:
    """The homography that maps ground points to pixels: direct linear transform, both sides brought to unit size.

    R. Hartley, In defence of the eight-point algorithm, TPAMI 19(6), 1997.

    Parameters
    ----------
    ground : float64 (n, 2)
        Metres; at least four points, no three of four on a line.
    pixel : float64 (n, 2)
        Undistorted pixels.

    Returns
    -------
    float64 (3, 3)
        Signed so that the points are in front of the camera.
    """
    unit_ground, unit_pixel = _unit(ground), _unit(pixel)
    x, y, one = unit_ground @ homogeneous(ground).T
    u, v, _ = unit_pixel @ homogeneous(pixel).T
    zero = np.zeros_like(x)
    along_u = np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], -1)
    along_v = np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], -1)
    rows = np.concatenate([along_u, along_v, np.zeros((1, 9))])  # with four points, 0 is the ninth singular value
    unit = np.linalg.svd(rows, full_matrices=False)[2][-1].reshape(3, 3)
    homography = np.linalg.inv(unit_pixel) @ unit @ unit_ground
    sign = 1.0 if np.median(homogeneous(ground) @ homography[2]) > 0 else -1.0
    return np.asarray(homography * sign / np.linalg.norm(homography[2]))


def fit_vertical(homography: Floats, ground: Floats, height: Floats, pixel: Floats) -> Floats:
    """Change of the third column of the homography by one metre of height: linear least squares.

    Parameters
    ----------
    homography : float64 (3, 3)
    ground : float64 (n, 2)
        Metres.
    height : float64 (n,)
        Metres above the ground, not 0.
    pixel : float64 (n, 2)
        Undistorted pixels.

    Returns
    -------
    float64 (3,)
    """
    foot = homogeneous(ground) @ homography.T
    u, v = pixel.T
    zero, one = np.zeros_like(u), np.ones_like(u)
    lever = (height / foot[:, 2])[:, None]
    along_u, along_v = np.stack([one, zero, -u], -1) * lever, np.stack([zero, one, -v], -1) * lever
    wanted = np.concatenate([u - foot[:, 0] / foot[:, 2], v - foot[:, 1] / foot[:, 2]])
    return np.asarray(np.linalg.lstsq(np.concatenate([along_u, along_v]), wanted)[0])


def focal_of_square_pixels(homography: Floats, size: tuple[int, int]) -> float | None:
    """The focal length of a camera with square pixels and an axis through the middle of its image.

    With H = K [r1 r2 t] and K known but for it, r1 r2 = 0 and |r1| = |r2| are two equations for 1 / f^2; least squares.

    Parameters
    ----------
    homography : float64 (3, 3)
        Ground metres to undistorted pixels.
    size
        Width and height of the image, pixels.

    Returns
    -------
    float, pixels, or None where it is not determined (a view straight down) or outside 0.2 to 10 image widths.
    """
    first, second, _ = (np.linalg.inv(middle_matrix(1.0, size)) @ homography).T
    # flat / f^2 + deep = 0
    flat = np.array([first[:2] @ second[:2], first[:2] @ first[:2] - second[:2] @ second[:2]])
    deep = np.array([first[2] * second[2], first[2] ** 2 - second[2] ** 2])
    inverse = -float(flat @ deep) / max(float(flat @ flat), 1e-300)
    return plausible_focal(float(1 / np.sqrt(inverse)), size) if inverse > 0 else None


def plausible_focal(focal: float, size: tuple[int, int]) -> float | None:
    """A focal length, or None where no lens has it."""
    return focal if _SHORTEST * size[0] < focal < _LONGEST * size[0] else None


def middle_matrix(focal: float, size: tuple[int, int]) -> Floats:
    """The camera matrix of square pixels and a principal point in the middle of the image, float64 (3, 3)."""
    return np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])


def vertical_of_matrix(homography: Floats, matrix: Floats) -> Floats:
    """The vertical of a camera of known matrix K: with H = K [r1 r2 t], a v = K (r1 x r2) in the scale of H.

    Parameters
    ----------
    homography : float64 (3, 3)
        Ground metres to undistorted pixels.
    matrix : float64 (3, 3)
        K, pixels.

    Returns
    -------
    float64 (3,)
    """
    r1, r2, _ = np.linalg.solve(matrix, homography).T
    upward = np.cross(r1, r2) / np.sqrt(np.linalg.norm(r1) * np.linalg.norm(r2))
    return np.asarray(matrix @ upward)


def homogeneous(point: Floats) -> Floats:
    """Points (..., 2) with a third coordinate of one, float64 (..., 3)."""
    return np.concatenate([point, np.ones_like(point[..., :1])], -1)


def _unit(point: Floats) -> Floats:
    """The similarity that brings points (n, 2) to mean 0 and unit size, float64 (3, 3)."""
    middle, size = point.mean(axis=0), max(float(point.std()), 1e-300)
    return np.array([[1 / size, 0, -middle[0] / size], [0, 1 / size, -middle[1] / size], [0, 0, 1]])
