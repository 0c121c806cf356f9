"""One camera from measured points: robust least squares of its homography and vertical.

The start is the direct linear transform, or MAGSAC++ where its points agree better (Barath et al., CVPR 2020, OpenCV).
A Cauchy loss on the reprojection errors in the distorted image finds outliers; the result is least squares over the
inliers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from stseg.arrays import Flags, Floats
from stseg.calibration.pinhole import ground_jacobian
from stseg.calibration.points.known_intrinsics import fit_pinhole
from stseg.calibration.points.point_requirements import require_ground, require_right_handed, require_upright
from stseg.errors import CalibrationError
from stseg.geometry import Camera, Grid, Lens
from stseg.geometry.fits import fit_homography, fit_vertical, focal_of_square_pixels, middle_matrix, vertical_of_matrix

VerticalFrom = Literal["points", "lens", "square pixels"]
"""Source of the vertical."""
_CLICK_SPREAD = 1.0
"""Least standard deviation of a clicked pixel, pixels."""
_MAGSAC_NOISE = 3.0
"""Greatest noise scale of MAGSAC++, pixels."""
_OUTLIER_LIMIT = 4.0
"""Outlier threshold, robust standard deviations."""
_NOISE_RATIO = 1.5
"""Greatest ratio of noise variances, pose to free homography, for the pose to be preferred."""
_DIFFERENCE = 1e-3
"""Step of the finite differences on the ground, metres."""
_MIN_POINTS = 5
"""Number of points up to which none is rejected."""


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


@dataclass(frozen=True)
class PointFit:
    """A fitted camera with its residuals and uncertainty."""

    camera: Camera
    points: Points
    """Input of the fit."""
    vertical_from: VerticalFrom
    """Source: "lens" (its camera matrix) or "square pixels" (centred principal point) where the points agree with it
    or too few are above the ground; else "points" above the ground."""
    off_pixel: Floats
    """float64 (n,): reprojection error of each point, pixels."""
    off_ground: Floats
    """float64 (n,): the same in the plane at the point's height, metres; nan above the horizon."""
    out: Flags
    """bool (n,): outliers."""
    parameters: Floats
    covariance: Floats
    """`parameters`: float64 (k,); `covariance`: float64 (k, k): the homography row by row, then the vertical where
    points determine it; up to scale."""

    def ground_deviation(self, grid: Grid) -> Floats:
        """Uncertainty of each ground cell, propagated from the fit's covariance.

        Returns
        -------
        float64 (y, x)
            Standard deviation along the worst direction, metres; nan where the camera does not see the ground.
        """
        camera, ground = self.camera, grid.ground
        pixel, ahead = camera.project(ground, 0.0)
        visible = ahead & camera.inside(pixel) & grid.inside()
        deviation = np.full(visible.shape, np.nan)
        if visible.any():
            level = np.zeros(int(visible.sum()))
            by_parameters = _slope(self.parameters, ground[visible], level, camera.lens)
            moved = np.linalg.solve(ground_jacobian(camera, ground[visible], _DIFFERENCE), by_parameters)
            spread = moved @ self.covariance @ np.swapaxes(moved, 1, 2)
            deviation[visible] = np.sqrt(np.linalg.eigvalsh(spread)[:, -1])
        return deviation


def fit_points(name: str, size: tuple[int, int], points: Points, lens: Lens | None = None) -> PointFit:
    """Fit a camera to at least four points on the ground, and optionally points above it.

    Parameters
    ----------
    name, size
        The camera's name, width and height of its image in pixels.
    points
        Two or more above the ground determine any camera; with fewer, the camera matrix of the lens is used, or
        square pixels and a centred principal point are assumed.
    lens
        The lens, where it is known.

    Raises
    ------
    CalibrationError
        Where the points determine no camera: fewer than four on the ground, collinear, mirrored, or seen from straight
        above with no point above the ground.
    """
    require_ground(name, points.ground[points.low], points.pixel[points.low])
    ideal = points.pixel if lens is None else lens.undistort(points.pixel)
    if not np.isfinite(ideal).all():
        found = points.pixel[~np.isfinite(ideal).all(axis=1)][0].tolist()
        raise CalibrationError(f"camera {name}", "points", f"a pixel {found} beyond its lens's field of view", "others")
    start = _start(points, ideal)
    high = ~points.low
    vertical_from: VerticalFrom = "points" if high.sum() > 1 else "lens" if lens is not None else "square pixels"
    free = start.ravel()
    if vertical_from == "points":
        free = np.append(free, fit_vertical(start, points.ground[high], points.height[high], ideal[high]))
    used = np.ones(len(high), bool) if vertical_from == "points" else points.low
    scale = np.linalg.norm(start[2])
    robust = _refined(free / scale, points, used, lens)
    wrong = _outliers(np.hypot(*(_project(robust.x, points.ground, points.height, lens) - points.pixel).T), used)
    used &= ~wrong
    fitted = _refined(robust.x, points, used, lens, "linear")
    parameters, freedom = fitted.x, len(fitted.fun) - (len(fitted.x) - 1)
    # Noise variance times the pseudo-inverse of J'J: the scale is free.
    noise = max(float(np.sum(fitted.fun**2)) / max(freedom, 1), _CLICK_SPREAD**2)
    covariance = np.asarray(noise * np.linalg.pinv(fitted.jac.T @ fitted.jac, rcond=1e-14, hermitian=True))
    pinhole = fit_pinhole(
        fitted.x[:9].reshape(3, 3), size, points.ground[used], points.height[used], points.pixel[used], lens
    )
    if pinhole is not None and pinhole.noise <= _NOISE_RATIO * noise:
        parameters, covariance = pinhole.parameters, pinhole.covariance(max(pinhole.noise, _CLICK_SPREAD**2))
        vertical_from = "square pixels" if lens is None else "lens"
    ground = parameters[:9].reshape(3, 3)
    vertical = parameters[9:] if len(parameters) > 9 else _assumed_vertical(name, ground, size, lens)
    require_right_handed(name, ground, vertical)
    camera = Camera(name, size, ground, vertical, lens)
    require_upright(camera)
    projected, _ = camera.project(points.ground, points.height)
    off = np.hypot(*(projected - points.pixel).T)
    out = wrong | _outliers(off, used)
    ground = [camera.back_project(pixel, z) for pixel, z in zip(points.pixel, points.height.tolist(), strict=True)]
    off_ground = np.hypot(*(np.array(ground) - points.ground).T)
    return PointFit(camera, points, vertical_from, off, off_ground, out, parameters, covariance)


def _outliers(off: Floats, used: Flags) -> Flags:
    """Outliers against the median of the points in use; none where a camera has few points."""
    limit = _OUTLIER_LIMIT * max(1.4826 * float(np.median(off[used])), _CLICK_SPREAD)
    return np.asarray((off > limit) & (used.sum() > _MIN_POINTS))


def _start(points: Points, ideal: Floats) -> Floats:
    """Initial homography: direct linear transform, or MAGSAC++ where its median error is smaller."""
    ground, pixel = points.ground[points.low], ideal[points.low]
    starts = [fit_homography(ground, pixel)]
    if len(ground) > 4:
        middle, reach = ground.mean(axis=0), ground.std()
        found, _ = cv2.findHomography((ground - middle) / reach, pixel, cv2.USAC_MAGSAC, _MAGSAC_NOISE, maxIters=10_000)
        if found is not None:
            unit = np.array([[1 / reach, 0, -middle[0] / reach], [0, 1 / reach, -middle[1] / reach], [0, 0, 1]])
            homography = np.asarray(found, float) @ unit
            depth = ground @ homography[2, :2] + homography[2, 2]
            starts.append(homography if np.median(depth) > 0 else -homography)
    misses = [_project(start.ravel(), ground, np.zeros(len(ground)), None) - pixel for start in starts]
    return min(zip(misses, starts, strict=True), key=lambda one: float(np.median(np.hypot(*one[0].T))))[1]


def _assumed_vertical(name: str, ground: Floats, size: tuple[int, int], lens: Lens | None) -> Floats:
    if lens is not None:
        return vertical_of_matrix(ground, lens.matrix)
    focal = focal_of_square_pixels(ground, size)
    if focal is None:
        raise CalibrationError(
            f"camera {name}",
            "points",
            "a view that leaves its focal length open, and fewer than two points above the ground",
            "two or more points with z above 0, such as the top of a door, or --lens",
        )
    return vertical_of_matrix(ground, middle_matrix(focal, size))


def _refined(
    start: Floats, points: Points, used: Flags, lens: Lens | None, loss: Literal["cauchy", "linear"] = "cauchy"
) -> OptimizeResult:
    """Least-squares (or Cauchy) refinement over the points in use."""
    ground, height, pixel = points.ground[used], points.height[used], points.pixel[used]

    def miss(parameters: Floats) -> Floats:
        return (_project(parameters, ground, height, lens) - pixel).ravel()

    spread = 1.4826 * float(np.median(np.abs(miss(start))))
    return least_squares(miss, start, x_scale="jac", loss=loss, f_scale=max(spread, _CLICK_SPREAD), max_nfev=500)


def _project(parameters: Floats, ground: Floats, height: Floats, lens: Lens | None) -> Floats:
    """Pixels of points under the parameters of `PointFit`, float64 (n, 2)."""
    image = np.concatenate([ground, np.ones((len(ground), 1))], 1) @ parameters[:9].reshape(3, 3).T
    if len(parameters) > 9:
        image = image + height[:, None] * parameters[9:]
    pixel = image[:, :2] / image[:, 2:]
    return pixel if lens is None else lens.distort(pixel)[0]


def _slope(parameters: Floats, ground: Floats, height: Floats, lens: Lens | None) -> Floats:
    """Jacobian of pixels in the parameters by finite differences, float64 (n, 2, k)."""
    step = 1e-6 * np.maximum(np.abs(parameters), 1e-3 * np.abs(parameters).max())
    columns = []
    for k, size in enumerate(step):
        move = np.zeros_like(parameters)
        move[k] = size
        later = _project(parameters + move, ground, height, lens)
        columns.append((later - _project(parameters - move, ground, height, lens)) / (2 * size))
    return np.stack(columns, -1)
