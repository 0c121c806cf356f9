"""Cameras as functions of unknowns, and their least-squares fit to points.

A free homography and vertical have eleven unknowns and a scale; a pose has six, and the focal length is a seventh where
no lens is given. Where the points agree with the simpler camera, it extrapolates far better, above all above the
ground. Radial coefficients of a lens may follow the focal length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from stseg.arrays import Flags, Floats
from stseg.calibration.pinhole import CENTRE, FOCAL, RADIAL, SIZE, TURN, lens_of, projection_of
from stseg.geometry import Lens
from stseg.geometry.fits import homogeneous

CLICK_SPREAD = 1.0
"""Least standard deviation of a clicked pixel, pixels."""
_OUTLIER_LIMIT = 4.0
"""Outlier threshold, by 1.4826 medians of the distances in the image."""
_MIN_POINTS = 5
"""Number of points up to which none is rejected."""
_EVALUATIONS = 100
"""Most evaluations of a fit: those of real points end within 35, those of mirrored ones would creep for seconds."""

Model = Callable[[Floats], tuple[Floats, Lens | None]]
"""From unknowns to a projection matrix, float64 (3, 4), and the lens."""


@dataclass(frozen=True)
class Points:
    """Measured points and their pixels in one camera."""

    pixel: Floats
    """float64 (n, 2)."""
    ground: Floats
    """float64 (n, 2): metres."""
    height: Floats
    """float64 (n,): metres above the ground."""

    @property
    def low(self) -> Flags:
        """Points on the ground, bool (n,)."""
        return np.asarray(self.height == 0)

    @property
    def place(self) -> Floats:
        """x, y, z, metres, float64 (n, 3)."""
        return np.column_stack([self.ground, self.height])


def free_model(lens: Lens | None) -> Model:
    """A homography row by row, and the vertical, or no vertical where there are nine unknowns."""

    def camera(unknowns: Floats) -> tuple[Floats, Lens | None]:
        ground, vertical = unknowns[:9].reshape(3, 3), unknowns[9:] if len(unknowns) > 9 else np.zeros(3)
        return np.column_stack([ground[:, :2], vertical, ground[:, 2]]), lens

    return camera


def pose_model(size: tuple[int, int], lens: Lens | None) -> Model:
    """Rotation vector and centre; where the lens is unknown, log focal length in widths, and k1, k2 as far as given."""

    def camera(unknowns: Floats) -> tuple[Floats, Lens | None]:
        view = np.zeros(SIZE)
        view[TURN], view[CENTRE] = unknowns[:3], unknowns[3:6]
        if lens is not None:
            return projection_of(view, lens.matrix), lens
        view[FOCAL] = unknowns[6]
        view[RADIAL.start : RADIAL.start + len(unknowns) - 7] = unknowns[7:]
        radial = lens_of(view, size)
        return projection_of(view, radial.matrix), radial if len(unknowns) > 7 else None

    return camera


def pose_start(homography: Floats, matrix: Floats) -> Floats:
    """Rotation vector and centre of H = K [r1 r2 t], with r1 and r2 made orthonormal, float64 (6,)."""
    r1, r2, shift = np.linalg.solve(matrix, homography).T
    scale = np.sqrt(np.linalg.norm(r1) * np.linalg.norm(r2))
    left, _, right = np.linalg.svd(np.column_stack([r1, r2, np.cross(r1, r2) / scale]) / scale)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return np.concatenate([Rotation.from_matrix(turn).as_rotvec(), -turn.T @ shift / scale])


def project(model: Model, unknowns: Floats, place: Floats) -> Floats:
    """Pixels of places (n, 3), float64 (n, 2)."""
    projection, lens = model(unknowns)
    image = homogeneous(place) @ projection.T
    pixel = image[:, :2] / image[:, 2:]
    return pixel if lens is None else lens.distort(pixel)[0]


@dataclass(frozen=True)
class ModelFit:
    """A model with the unknowns that fit points best."""

    model: Model
    unknowns: Floats
    used: Flags
    """bool (n,): the points of the fit; outliers are left out."""
    normal: Floats
    """float64 (k, k): J'J of the reprojection errors, square pixels over the product of two unknowns' units."""
    squares: float
    """Sum of the squared errors, square pixels."""

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the errors; a projection's scale is no unknown."""
        return max(2 * int(self.used.sum()) - len(self.unknowns) + (len(self.unknowns) >= 9), 1)

    @property
    def noise(self) -> float:
        """Variance of a pixel, square pixels."""
        return self.squares / self.freedom

    @property
    def covariance(self) -> Floats:
        """Covariance of the unknowns, float64 (k, k), for clicks that are no better than `CLICK_SPREAD`."""
        inverse = np.linalg.pinv(self.normal, rcond=1e-14, hermitian=True)
        return np.asarray(max(self.noise, CLICK_SPREAD**2) * inverse)

    def refit(self, points: Points, used: Flags) -> ModelFit:
        """The fit to other points, by plain least squares."""
        return fit_model(self.model, self.unknowns, points, used, robust=False)


@np.errstate(over="ignore", invalid="ignore")  # of steps that are not taken
def fit_model(model: Model, start: Floats, points: Points, used: Flags, robust: bool = True) -> ModelFit:
    """Least squares over the points in use; with `robust`, a Cauchy loss finds the outliers among them first."""

    def miss(unknowns: Floats) -> Floats:
        return (project(model, unknowns, points.place[used]) - points.pixel[used]).ravel()

    if robust:
        spread = max(1.4826 * float(np.median(np.abs(miss(start)))), CLICK_SPREAD)
        start = least_squares(miss, start, x_scale="jac", loss="cauchy", f_scale=spread, max_nfev=_EVALUATIONS).x
        used = used & ~outliers(np.hypot(*(project(model, start, points.place) - points.pixel).T), used)
    found = least_squares(miss, start, x_scale="jac", max_nfev=_EVALUATIONS)
    jacobian: Floats = np.asarray(found.jac)
    return ModelFit(model, found.x, used, np.asarray(jacobian.T @ jacobian), float(np.sum(found.fun**2)))


def outliers(off: Floats, used: Flags) -> Flags:
    """Outliers against the median of the points in use; none where a camera has few points."""
    limit = _OUTLIER_LIMIT * max(1.4826 * float(np.median(off[used])), CLICK_SPREAD)
    return np.asarray((off > limit) & (used.sum() > _MIN_POINTS))
