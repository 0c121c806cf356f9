"""One camera from measured points: robust least squares of its homography and vertical, or of its pose.

The start is the direct linear transform. A Cauchy loss on the reprojection errors in the distorted image finds
outliers; the result is least squares over the inliers. All is computed in a frame whose plane z = 0 holds four points:
the ground, or a wall.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.linalg import rq

from stseg.arrays import Flags, Floats
from stseg.calibration.pinhole import ground_jacobian
from stseg.calibration.points.camera_models import (
    CLICK_SPREAD,
    ModelFit,
    Points,
    fit_model,
    free_model,
    outliers,
    pose_model,
    pose_start,
    project,
)
from stseg.calibration.points.point_requirements import MIN_POINTS, require_plane, require_unmirrored
from stseg.calibration.points.radial_lens import fit_radial_lens
from stseg.calibration.points.reference_plane import in_plane_frame, plane_frame
from stseg.errors import CalibrationError
from stseg.geometry import Camera, Grid, Lens
from stseg.geometry.fits import (
    fit_homography,
    fit_vertical,
    focal_of_square_pixels,
    homogeneous,
    middle_matrix,
    plausible_focal,
    vertical_of_matrix,
)

VerticalFrom = Literal["points", "lens", "square pixels", "radial lens"]
"""Source of the vertical."""
_NOISE_RATIO = 1.5
"""Greatest ratio of noise variances, pose to free homography, for the pose to be preferred."""
_GROSS_ERROR = 4.0
"""Median error of the direct linear transform from which on some points are taken for wrong, pixels."""
_FEW_POINTS = 30
"""Points up to which two wrong ones can turn the plane over; of more, all pairs would take long."""
_DIFFERENCE = 1e-3
"""Step of the finite differences on the ground, metres."""


@dataclass(frozen=True)
class PointFit:
    """A fitted camera with its residuals and uncertainty."""

    camera: Camera
    points: Points
    """Input of the fit."""
    vertical_from: VerticalFrom
    """Source: "lens" (its camera matrix) or "square pixels" (centred principal point, perhaps with a "radial lens" that
    the points bear out) where the points agree with it or too few are off the plane of reference; else "points"."""
    off_pixel: Floats
    """float64 (n,): reprojection error of each point, pixels."""
    off_ground: Floats
    """float64 (n,): the same on the plane of reference, metres; off it, by the pixels that a metre off it covers."""
    out: Flags
    """bool (n,): outliers."""
    frame: Floats
    """float64 (4, 4): from the world to the frame of the plane of reference."""
    inner: Points
    """The points in that frame; those of the plane have no height."""
    model: ModelFit
    """The camera's model in that frame, and its covariance."""

    def ground_deviation(self, grid: Grid) -> Floats:
        """Uncertainty of each ground cell, propagated from the fit's covariance.

        Where the camera sees nothing of the ground, that of the lowest plane that it sees.

        Returns
        -------
        float64 (y, x)
            Standard deviation along the worst direction, metres; nan where the camera does not see it.
        """
        camera, deviation = self.camera, np.full(grid.shape[1:], np.nan)
        for height in grid.heights.tolist():
            if (visible := camera.sees(grid.ground, height) & grid.inside()).any():
                ground = grid.ground[visible]
                by_unknowns = self._slope(np.column_stack([ground, np.full(len(ground), height)]))
                moved = np.linalg.solve(ground_jacobian(camera, ground, _DIFFERENCE, height), by_unknowns)
                spread = moved @ self.model.covariance @ np.swapaxes(moved, 1, 2)
                deviation[visible] = np.sqrt(np.linalg.eigvalsh(spread)[:, -1])
                break
        return deviation

    def _slope(self, place: Floats) -> Floats:
        """Jacobian of the pixels of places (n, 3) in the model's unknowns by finite differences, float64 (n, 2, k)."""
        unknowns, inner = self.model.unknowns, homogeneous(place) @ self.frame[:3].T
        steps = np.diag(1e-6 * np.maximum(np.abs(unknowns), 1e-3 * np.abs(unknowns).max()))
        pixels = [[project(self.model.model, unknowns + side * step, inner) for side in (1, -1)] for step in steps]
        return np.stack([(one - two) / (2 * step.max()) for (one, two), step in zip(pixels, steps, strict=True)], -1)


def fit_points(name: str, size: tuple[int, int], points: Points, lens: Lens | None = None) -> PointFit:
    """Fit a camera to at least four points on the ground or on another plane, and optionally points off it.

    Parameters
    ----------
    name, size
        The camera's name, width and height of its image in pixels.
    points
        Two or more off the plane determine any camera; with fewer, the camera matrix of the lens is used, or
        square pixels and a centred principal point are assumed.
    lens
        The lens, where it is known; else eight points or more may bear out a radial one.

    Raises
    ------
    CalibrationError
        Where the points determine no camera: fewer than four on a plane, collinear, mirrored, or seen along the plane's
        normal with no point off it.
    """
    frame = plane_frame(points.place)
    inner = in_plane_frame(points, frame)
    require_plane(name, inner.ground[inner.low], inner.pixel[inner.low])
    ideal = inner.pixel if lens is None else lens.undistort(inner.pixel)
    if not np.isfinite(ideal).all():
        found = inner.pixel[~np.isfinite(ideal).all(axis=1)][0].tolist()
        raise CalibrationError(f"camera {name}", "points", f"a pixel {found} beyond its lens's field of view", "others")
    free = _free_fit(inner, ideal, lens)
    fit, vertical_from = _preferred(free, _pose_fit(free, size, inner, lens), inner, lens)
    projection, own_lens = fit.model(fit.unknowns)
    if len(fit.unknowns) == 9:
        projection[:, 2] = _assumed_vertical(name, projection[:, [0, 1, 3]], size, lens)
    camera = Camera.from_projection(name, size, projection @ frame, own_lens)
    require_unmirrored(camera, projection)
    off = np.hypot(*(camera.project(points.ground, points.height)[0] - points.pixel).T)
    local = Camera.from_projection(name, size, projection, own_lens)
    on_plane = np.hypot(*(local.back_project(inner.pixel, 0.0) - inner.ground).T)
    risen, below = (local.project(inner.ground, inner.height + up)[0] for up in (_DIFFERENCE, 0.0))
    off_ground = np.where(inner.low, on_plane, off * _DIFFERENCE / np.hypot(*(risen - below).T))
    out = outliers(off, fit.used | inner.low)  # a point that the fit left out counts
    return PointFit(camera, points, vertical_from, off, off_ground, out, frame, inner, fit)


def _free_fit(points: Points, ideal: Floats, lens: Lens | None) -> ModelFit:
    """Homography and, where two points or more determine it, the vertical."""
    high = ~points.low
    start = _robust_homography(points.ground[points.low], ideal[points.low])
    unknowns, used = start.ravel(), points.low
    if high.sum() > 1:
        vertical = fit_vertical(start, points.ground[high], points.height[high], ideal[high])
        unknowns, used = np.append(unknowns, vertical), np.ones(len(high), bool)
    return fit_model(free_model(lens), unknowns / np.linalg.norm(start[2]), points, used)


def _robust_homography(ground: Floats, pixel: Floats) -> Floats:
    """The homography of all points, or where these err grossly, without one or two, by the least median of the errors.

    P. Rousseeuw, Least median of squares regression, JASA 79, 1984. One wrong point may turn the plane over.
    """

    def error(homography: Floats) -> float:
        image = homogeneous(ground) @ homography.T
        return float(np.median(np.hypot(*(image[:, :2] / image[:, 2:] - pixel).T)))

    whole, rows = fit_homography(ground, pixel), np.arange(len(ground))
    if error(whole) < _GROSS_ERROR or len(rows) > _FEW_POINTS:
        return whole
    left_out = [pair for count in (1, 2) if len(rows) > MIN_POINTS + count for pair in combinations(rows, count)]
    kept = [np.setdiff1d(rows, pair) for pair in left_out]
    return min([whole, *(fit_homography(ground[some], pixel[some]) for some in kept)], key=error)


def _pose_fit(free: ModelFit, size: tuple[int, int], points: Points, lens: Lens | None) -> ModelFit | None:
    """The pose of a camera with that lens, or square pixels and a centred axis; None where its focal length is open."""
    projection, _ = free.model(free.unknowns)
    homography = projection[:, [0, 1, 3]]
    if lens is not None:
        return fit_model(pose_model(size, lens), pose_start(homography, lens.matrix), points, free.used, robust=False)
    focal = focal_of_square_pixels(homography, size)
    if focal is None and len(free.unknowns) > 9:
        across, down, depth = np.abs(np.diag(rq(projection[:, :3])[0]))
        focal = plausible_focal(float(np.sqrt(across * down) / max(depth, 1e-300)), size)
    if focal is None:
        return None
    start = np.append(pose_start(homography, middle_matrix(focal, size)), np.log(focal / size[0]))
    return fit_model(pose_model(size, None), start, points, free.used, robust=False)


def _preferred(
    free: ModelFit, pose: ModelFit | None, points: Points, lens: Lens | None
) -> tuple[ModelFit, VerticalFrom]:
    bent = fit_radial_lens(pose, free, points) if pose is not None and lens is None else None
    if bent is not None:
        return bent, "radial lens"
    if pose is not None and pose.noise <= _NOISE_RATIO * max(free.noise, CLICK_SPREAD**2):
        return pose, "square pixels" if lens is None else "lens"
    return free, "points" if len(free.unknowns) > 9 else "square pixels" if lens is None else "lens"


def _assumed_vertical(name: str, ground: Floats, size: tuple[int, int], lens: Lens | None) -> Floats:
    if lens is not None:
        return vertical_of_matrix(ground, lens.matrix)
    focal = focal_of_square_pixels(ground, size)
    if focal is None:
        raise CalibrationError(
            f"camera {name}",
            "points",
            "a view that leaves its focal length open, and fewer than two points off the plane of the others",
            "two or more points with z above 0, such as the top of a door, or off their wall, or --lens",
        )
    return vertical_of_matrix(ground, middle_matrix(focal, size))
