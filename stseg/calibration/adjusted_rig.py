"""The rig of a bundle adjustment, and the reprojection statistics of each view."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import approx_fprime

from stseg.arrays import Floats, Ints
from stseg.calibration.automatic.solution import SolvedViews
from stseg.calibration.bundle_adjustment import BundleParameters
from stseg.calibration.pinhole import CENTRE, CLOCK, FOCAL, SIZE, as_camera, height_of_head, moved, on_plane
from stseg.geometry import Camera, Grid

_MARGIN = 0.5
"""Margin of the grid around the adjusted ground points, metres."""
_STEP_SIZE = 1e-6


@dataclass(frozen=True)
class ViewReport:
    """Agreement of one view with the others."""

    observations: int
    """Number of endpoint pairs (a person in a frame) that this view shares with another."""
    foot_pixels: float
    head_pixels: float
    """Median reprojection errors of feet and heads."""
    ground_metres: float
    """Median distance on the ground between this view's feet and the adjusted points."""
    head_metres: float
    """Median difference between this view's head heights and the adjusted ones."""
    focal: float
    focal_spread: float
    """Focal length and its standard deviation, pixels."""
    centre_spread: float
    """Standard deviation of the camera centre from the middle of the ground, that of the scale included, metres."""
    clock: float
    clock_spread: float
    """Residual delay beyond whole frames, and its standard deviation, seconds."""


def scaled(solution: SolvedViews, factor: float) -> SolvedViews:
    """The solution with all lengths multiplied by a factor, covariance included."""
    return _moved(solution, 0.0, np.zeros(2), factor)


def centred(solution: SolvedViews) -> SolvedViews:
    """The solution with the origin in the middle of the ground points and x along the first camera's right."""
    parameters = solution.adjustment.parameters
    middle = (parameters.points[:, :2].max(axis=0) + parameters.points[:, :2].min(axis=0)) / 2
    toward = middle - parameters.views[0, CENTRE][:2]
    return _moved(solution, np.pi / 2 - float(np.arctan2(toward[1], toward[0])), middle, 1.0)


def _moved(solution: SolvedViews, turn: float, middle: Floats, scale: float) -> SolvedViews:
    """The solution turned about a middle, which becomes the origin, and scaled."""
    adjustment, matched = solution.adjustment, solution.problem.correspondences
    about = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    places = adjustment.parameters.points
    points = np.column_stack([(places[:, :2] - middle) @ about.T, scale * places[:, 2]])
    old = adjustment.parameters.views

    def after(view: Floats) -> Floats:
        return moved(view, turn, -about @ middle, scale)

    views = np.array([after(view) for view in old])
    slope = block_diag(*(approx_fprime(view, after, _STEP_SIZE) for view in old), scale * np.eye(2))
    ground = replace(matched, ground=(matched.ground - middle) @ about.T, velocity=matched.velocity @ about.T)
    adjustment = replace(
        adjustment,
        parameters=BundleParameters(views, scale * adjustment.parameters.toe_offset, points),
        covariance=slope @ adjustment.covariance @ slope.T,
    )
    problem = replace(solution.problem, correspondences=ground, height=scale * solution.problem.height)
    return replace(solution, adjustment=adjustment, problem=problem)


def cameras_of(solution: SolvedViews, names: Sequence[str]) -> tuple[Camera, ...]:
    """The adjusted cameras as `Camera` objects."""
    return tuple(
        as_camera(view, name, solution.problem.size_of(k))
        for k, (name, view) in enumerate(zip(names, solution.adjustment.parameters.views, strict=True))
    )


def offsets_of(solution: SolvedViews) -> Ints:
    """Offset of each stream in the rig file; 0 or below, so that every stream covers the recording's first frame."""
    return np.asarray(solution.delay.min() - solution.delay)


def grid_of(solution: SolvedViews, cell: float) -> Grid:
    """A grid over the adjusted ground points."""
    ground = solution.adjustment.parameters.points[:, :2]
    lowest = np.floor((np.percentile(ground, 1, axis=0) - _MARGIN) / cell) * cell
    high = np.ceil((np.percentile(ground, 99, axis=0) + _MARGIN) / cell) * cell
    x, y = np.round(np.stack([lowest, high], 1), 6).tolist()
    return Grid((x[0], x[1]), (y[0], y[1]), cell)


def reports_of(solution: SolvedViews, scale_spread: float) -> list[ViewReport]:
    """A report of each view; `scale_spread` is the relative standard deviation of all lengths."""
    return [_report(solution, view, scale_spread) for view in range(len(solution.delay))]


def _report(solution: SolvedViews, view: int, scale_spread: float) -> ViewReport:
    adjustment, correspondences = solution.adjustment, solution.problem.correspondences
    parameters, size = adjustment.parameters, solution.problem.size_of(view)
    rows = np.flatnonzero(correspondences.view == view)
    length = np.hypot(*(correspondences.foot[rows] - correspondences.head[rows]).T)
    residual_pixels = np.linalg.norm(adjustment.residual[rows], axis=2) * length[:, None]
    points = parameters.points[correspondences.point[rows]]
    camera = parameters.views[view]
    toward = camera[CENTRE][:2] - points[:, :2]
    lowest = points[:, :2] + parameters.toe_offset[0] * toward / np.linalg.norm(toward, axis=1, keepdims=True)
    away = np.linalg.norm(on_plane(camera, size, correspondences.foot[rows], 0.0) - lowest, axis=1)
    heights = height_of_head(camera, size, correspondences.head[rows], points[:, :2])
    focal = size[0] * float(np.exp(camera[FOCAL]))
    spread = np.sqrt(np.maximum(np.diag(adjustment.covariance)[SIZE * view : SIZE * (view + 1)], 0.0))
    return ViewReport(
        observations=len(rows),
        foot_pixels=float(np.nanmedian(residual_pixels[:, 0])),
        head_pixels=float(np.nanmedian(residual_pixels[:, 1])),
        ground_metres=float(np.nanmedian(away)),
        head_metres=float(np.nanmedian(np.abs(heights - points[:, 2]))),
        focal=focal,
        focal_spread=focal * float(spread[FOCAL]),
        centre_spread=float(np.hypot(np.linalg.norm(spread[CENTRE]), scale_spread * np.linalg.norm(camera[CENTRE]))),
        clock=float(camera[CLOCK]),
        clock_spread=float(spread[CLOCK]),
    )
