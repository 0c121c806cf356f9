"""Pose of a camera with known intrinsics, or with square pixels and a centred principal point.

A free homography and vertical have eleven unknowns; a pose has six, and the focal length is a seventh where no lens is
given. Where the points agree with the simpler camera, it extrapolates far better, above all above the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.geometry import Lens
from stseg.geometry.fits import focal_of_square_pixels, middle_matrix


@dataclass(frozen=True)
class Pinhole:
    """A camera pose with its uncertainty."""

    parameters: Floats
    """float64 (12,): homography row by row, then the vertical."""
    slope: Floats
    """float64 (12, k): their Jacobian in the k unknowns."""
    normal: Floats
    """float64 (k, k): J'J of the reprojection errors in the unknowns, 1 / square pixels."""
    noise: float
    """Squared error per degree of freedom, square pixels."""

    def covariance(self, noise: float) -> Floats:
        """Covariance of the parameters, float64 (12, 12), for a noise variance in square pixels."""
        inverse = np.asarray(np.linalg.pinv(self.normal, hermitian=True), float)
        return np.asarray(noise * self.slope @ inverse @ self.slope.T)


def fit_pinhole(
    homography: Floats, size: tuple[int, int], ground: Floats, height: Floats, pixel: Floats, lens: Lens | None
) -> Pinhole | None:
    """Fit the pose that minimises squared reprojection errors; None where the homography allows no start.

    Parameters
    ----------
    homography : float64 (3, 3)
        Start, signed so that the points lie before the camera.
    size
        Width and height of the image, pixels.
    ground : float64 (n, 2), height : float64 (n,)
        Metres.
    pixel : float64 (n, 2)
        Pixels of the distorted image.
    lens
        The lens, if known.
    """
    focal = None if lens is not None else focal_of_square_pixels(homography, size)
    if lens is None and focal is None:
        return None
    fixed = lens.matrix if lens is not None else None

    def unfold(unknowns: Floats) -> Floats:
        matrix = middle_matrix(float(np.exp(unknowns[6])), size) if fixed is None else fixed
        turn = np.asarray(Rotation.from_rotvec(unknowns[:3]).as_matrix())
        return np.concatenate([(matrix @ np.column_stack([turn[:, :2], unknowns[3:6]])).ravel(), matrix @ turn[:, 2]])

    def miss(unknowns: Floats) -> Floats:
        flat = unfold(unknowns)
        image = np.column_stack([ground, np.ones(len(ground))]) @ flat[:9].reshape(3, 3).T + height[:, None] * flat[9:]
        projected = image[:, :2] / image[:, 2:]
        return ((projected if lens is None else lens.distort(projected)[0]) - pixel).ravel()

    start = _start(homography, fixed if fixed is not None else middle_matrix(focal or 1.0, size))
    if focal is not None:
        start = np.append(start, np.log(focal))
    found = least_squares(miss, start, x_scale="jac", max_nfev=300)
    step = 1e-6
    slope = np.stack(
        [(unfold(found.x + move) - unfold(found.x - move)) / (2 * step) for move in step * np.eye(len(start))], -1
    )
    jacobian: Floats = np.asarray(found.jac)
    noise = float(np.sum(found.fun**2)) / max(len(found.fun) - len(start), 1)
    return Pinhole(unfold(found.x), slope, np.asarray(jacobian.T @ jacobian), noise)


def _start(homography: Floats, matrix: Floats) -> Floats:
    """Rotation vector and translation of H = K [r1 r2 t], with r1 and r2 made orthonormal."""
    r1, r2, shift = np.linalg.solve(matrix, homography).T
    scale = np.sqrt(np.linalg.norm(r1) * np.linalg.norm(r2))
    left, _, right = np.linalg.svd(np.column_stack([r1, r2, np.cross(r1, r2) / scale]) / scale)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return np.concatenate([Rotation.from_matrix(turn).as_rotvec(), shift / scale])
