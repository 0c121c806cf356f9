"""Robust bundle adjustment of cameras, clock offsets, ground points and body heights.

An observation is a foot and a head in a view. A head is a point in space. The lowest point of a silhouette is nearer to
the camera than the body's axis, by an offset that is adjusted too. Levenberg-Marquardt steps with the points
eliminated (Triggs et al., Bundle adjustment: a modern synthesis, 2000, section 6.1), Geman-McClure weights.
"""

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.calibration.automatic.correspondence import Correspondences
from stseg.calibration.pinhole import CENTRE, CLOCK, ENDS, FOCAL, MIDDLE, RADIAL, SIZE, moved, project

_STEP_SIZES = np.array([1e-5] * 5 + [1e-5] * 3 + [1e-4] * 3 + [1e-3] + [1e-4] * 2)
"""Steps of the finite differences of a camera's parameters."""
_PRIOR_SPREAD = np.zeros(SIZE)
_PRIOR_SPREAD[FOCAL], _PRIOR_SPREAD[MIDDLE], _PRIOR_SPREAD[RADIAL], _PRIOR_SPREAD[ENDS] = 0.5, 0.01, 0.25, 0.0025
_PRIOR_MEAN = np.zeros(SIZE)
_PRIOR_MEAN[FOCAL], _PRIOR_MEAN[3] = np.log(0.85), -0.15
_LENS_SPREAD = {FOCAL: 0.05, 3: 0.05, 4: 0.05}
"""Standard deviations of log focal length, k1 and k2 between cameras of one make."""
_TOE_MEAN, _TOE_SPREAD = np.array([0.16, 0.12]), np.array([0.05, 0.04])
"""Prior of `BundleParameters.toe_offset`. It is tight: the data confuse it with the height of the ground, and the small
errors of lens and tilt that no adjustment knows of would decide. Real shoes and half steps were measured."""
_MAX_STEP_SPEED = 1.5
"""Speed above which steps no longer lengthen, m/s."""
_OUTLIER_RESIDUAL = 3.0
"""Residual, in standard deviations, at which an observation's weight is a quarter."""
_ITERATIONS = 40


@dataclass(frozen=True)
class BundleParameters:
    """Parameters of the adjustment."""

    views: Floats
    """float64 (view, 14): see `stseg.calibration.pinhole`."""
    toe_offset: Floats
    """float64 (2,): distance from a body's axis to its lowest visible point, towards the camera: metres at rest or
    walking across, and metres for each m/s along the viewing ray (half a step)."""
    points: Floats
    """float64 (n, 3): x, y and head height of each person in each frame, metres."""


@dataclass(frozen=True)
class BundleProblem:
    """Observations of the adjustment, and their weights."""

    size: Ints
    """int64 (view, 2): width and height of the images, pixels."""
    correspondences: Correspondences
    """Points and their observations."""
    spread: Floats
    """float64 (m, 2, 2): standard deviation of foot and head along and across the body, in body lengths."""
    height: Floats
    """float64 (n,): prior mean of each point's head height, metres."""
    height_spread: float
    """Its standard deviation."""
    redundancy: float
    """Observations per independent observation: errors within one step are correlated."""
    clock_spread: float
    """Standard deviation of the residual clock offsets, seconds."""
    make: Floats
    """float64 (view,): weight of a camera as one of the make of the others, 0..1, see `same_make`."""
    body: Floats
    """float64 (m,): 1 for an observation of a person, 0 for one of a floor feature: that has no toe offset, and a head
    of infinite spread."""

    def size_of(self, view: int) -> tuple[int, int]:
        """Width and height of a view's images, pixels."""
        width, height = self.size[view].tolist()
        return width, height


@dataclass(frozen=True)
class Adjustment:
    """Adjusted parameters, their covariance and the residuals."""

    parameters: BundleParameters
    covariance: Floats
    """float64 (14 view + 2, 14 view + 2): of the cameras and `toe_offset`, marginal over the points; the gauge (turn,
    shift and time) is spread evenly."""
    residual: Floats
    """float64 (m, 2, 2): foot and head of each observation, observed minus predicted, along and across the body, in
    body lengths; nan behind a camera."""
    freedom: Floats
    """float64 (m, 2, 2): share of each residual's variance that the adjusted points have left, 0..1."""


def adjust(parameters: BundleParameters, problem: BundleProblem) -> Adjustment:
    """The maximum a posteriori parameters near the given ones."""
    damping, cost = 1e-3, _cost(parameters, problem)
    for _ in range(_ITERATIONS):
        system = _system(parameters, problem)
        for _ in range(8):
            moved = _stepped(parameters, system, damping)
            lower = _cost(moved, problem)
            if lower < cost:
                break
            damping *= 6
        else:
            break
        gain, parameters, cost, damping = cost - lower, moved, lower, max(damping / 6, 1e-9)
        if gain < 1e-5 * cost:
            break
    system = _system(parameters, problem)
    reduced, inverse = _reduced(system, 0.0)
    of_point = inverse[problem.correspondences.point]
    freedom = 1 - np.einsum("mri,mij,mrj->mr", system.by_point, of_point, system.by_point, optimize=True)
    covariance = _covariance(reduced, parameters)
    return Adjustment(parameters, covariance, residuals(parameters, problem), freedom.reshape(-1, 2, 2))


def _covariance(reduced: Floats, parameters: BundleParameters) -> Floats:
    """Inverse of the reduced camera system in the subspace orthogonal to the gauge."""
    free = np.zeros((4, len(reduced)))
    free[3, CLOCK : SIZE * len(parameters.views) : SIZE] = 1.0
    for k, (turn, shift) in enumerate(((1e-5, (0.0, 0.0)), (0.0, (1e-5, 0.0)), (0.0, (0.0, 1e-5)))):
        changed = np.array([moved(view, turn, np.array(shift), 1.0) for view in parameters.views])
        free[k, : changed.size] = (changed - parameters.views).ravel() / 1e-5
    basis = np.linalg.qr(free.T)[0]
    projector = np.eye(len(reduced)) - basis @ basis.T
    stiff = float(np.abs(np.diag(reduced)).max())
    return np.asarray(projector @ np.linalg.inv(projector @ reduced @ projector + stiff * basis @ basis.T) @ projector)


def residuals(parameters: BundleParameters, problem: BundleProblem) -> Floats:
    """Residuals of all observations, see `Adjustment`."""
    views, points = parameters.views[problem.correspondences.view], parameters.points[problem.correspondences.point]
    return _residuals(views, parameters.toe_offset, points, problem)


def _residuals(views: Floats, toe_offset: Floats, points: Floats, problem: BundleProblem) -> Floats:
    correspondences = problem.correspondences
    width, height = problem.size[correspondences.view].T.astype(float)
    velocity = correspondences.velocity[correspondences.point]
    place = points.copy()
    place[:, :2] -= views[:, CLOCK, None] * velocity
    toward = views[:, CENTRE][:, :2] - place[:, :2]
    toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-6)
    forward = toe_offset[0] + toe_offset[1] * np.minimum(np.abs((toward * velocity).sum(axis=1)), _MAX_STEP_SPEED)
    forward *= problem.body
    lowest = np.column_stack([place[:, :2] + forward[:, None] * toward, np.zeros(len(place))])
    down = correspondences.foot - correspondences.head
    square = (down**2).sum(axis=1)[:, None]
    foot = correspondences.foot - project(views, width, height, lowest)
    head = correspondences.head - project(views, width, height, place)
    excess = (problem.body * width / np.sqrt(square[:, 0]))[:, None] * views[:, ENDS]
    foot -= excess[:, :1] * down
    head += excess[:, 1:] * down
    across = np.stack([-down[:, 1], down[:, 0]], -1)
    return np.asarray(
        np.stack([[(end * way).sum(axis=1) for way in (down, across)] for end in (foot, head)]).transpose(2, 0, 1)
        / (square[..., None])
    )


def _squares(residual: Floats, problem: BundleProblem) -> Floats:
    """Squared normalised residual of each endpoint, float64 (m, 2)."""
    return np.asarray(((np.nan_to_num(residual, nan=1e3) / problem.spread) ** 2).sum(axis=2))


def _cost(parameters: BundleParameters, problem: BundleProblem) -> float:
    square = _squares(residuals(parameters, problem), problem)
    robust = (square / (1.0 + square / _OUTLIER_RESIDUAL**2)).sum() / problem.redundancy
    heights = (((parameters.points[:, 2] - problem.height) / problem.height_spread) ** 2).sum()
    return float(robust + heights / problem.redundancy + _prior(parameters, problem)[0])


def _prior(parameters: BundleParameters, problem: BundleProblem) -> tuple[float, Floats, Floats]:
    """Cost, half gradient and half Hessian of the prior on cameras and toe offset."""
    constrained = _PRIOR_SPREAD > 0
    weight = np.where(constrained, 1.0 / np.where(constrained, _PRIOR_SPREAD, 1.0) ** 2, 0.0)
    weight[CLOCK] = problem.clock_spread**-2
    matrix = np.diag(np.append(np.tile(weight, len(parameters.views)), _TOE_SPREAD**-2))
    same_lens = np.diag(problem.make) - np.outer(problem.make, problem.make) / max(problem.make.sum(), 1e-9)
    for place, spread in _LENS_SPREAD.items():
        rows = place + SIZE * np.arange(len(parameters.views))
        matrix[np.ix_(rows, rows)] += same_lens / spread**2
    off = np.append((parameters.views - _PRIOR_MEAN).ravel(), parameters.toe_offset - _TOE_MEAN)
    slope = matrix @ off
    return float(off @ slope), slope, matrix


def same_make(views: Floats, size: Ints) -> Floats:
    """Weight of each camera as one of the make of most others, 0..1.

    These have images of one size and a focal length near the median. People in a part of an image tell focal length
    and lens apart badly; cameras of a rig are mostly of one make, and each sees people in another part. The weights are
    those of Geman and McClure, so another lens is left alone.

    Parameters
    ----------
    views : float64 (view, 14)
        Approximate cameras.
    size : int64 (view, 2)
        Width and height of their images, pixels.
    """
    make = np.zeros(len(views))
    for image_size in np.unique(size, axis=0):
        rows = np.flatnonzero((size == image_size).all(axis=1))
        if len(rows) > make.astype(bool).sum():
            off = (views[rows, FOCAL] - np.median(views[rows, FOCAL])) / _LENS_SPREAD[FOCAL]
            make[:] = 0
            make[rows] = (1 + (off / _OUTLIER_RESIDUAL) ** 2) ** -2
    return make


@dataclass(frozen=True)
class _System:
    """Blocks of the normal equations: cameras, points, and the coupling; the weighted Jacobian in the points."""

    cameras: Floats
    camera_slope: Floats
    people: Floats
    people_slope: Floats
    between: Floats
    by_point: Floats


def _system(parameters: BundleParameters, problem: BundleProblem) -> _System:
    correspondences = problem.correspondences
    of_view, of_point = parameters.views[correspondences.view], parameters.points[correspondences.point]
    toe = parameters.toe_offset
    residual = _residuals(of_view, toe, of_point, problem)
    ahead: Flags = np.asarray(np.isfinite(residual).all(axis=(1, 2)))
    weight = np.where(ahead[:, None], (1.0 + _squares(residual, problem) / _OUTLIER_RESIDUAL**2) ** -2, 0.0)
    root = (np.sqrt(weight / problem.redundancy)[..., None] / problem.spread).reshape(-1, 4)

    def slope(views: Floats, toe_offset: Floats, points: Floats, step: float) -> Floats:
        changed = (_residuals(views, toe_offset, points, problem) - residual).reshape(-1, 4) / step
        return np.where(np.isfinite(changed), changed, 0.0) * root

    by_view = np.stack([slope(of_view + h * _unit(k, SIZE), toe, of_point, h) for k, h in enumerate(_STEP_SIZES)], -1)
    by_toe = np.stack([slope(of_view, toe + 1e-4 * _unit(k, 2), of_point, 1e-4) for k in range(2)], -1)
    by_point = np.stack([slope(of_view, toe, of_point + 1e-4 * _unit(k, 3), 1e-4) for k in range(3)], -1)
    weighted_residual = np.nan_to_num(residual.reshape(-1, 4)) * root
    rows = np.zeros((len(residual), 4, SIZE * len(parameters.views) + len(parameters.toe_offset)))
    columns = SIZE * correspondences.view[:, None] + np.arange(SIZE)
    np.put_along_axis(rows, np.repeat(columns[:, None], 4, axis=1), by_view, axis=2)
    rows[:, :, -2:] = by_toe
    return _normal(parameters, problem, rows, by_point, weighted_residual)


def _normal(
    parameters: BundleParameters, problem: BundleProblem, rows: Floats, by_point: Floats, weighted_residual: Floats
) -> _System:
    """Normal equations from weighted Jacobians and residuals; observations of one point are consecutive."""
    first = np.flatnonzero(np.diff(problem.correspondences.point, prepend=-1))
    transposed = by_point.transpose(0, 2, 1)
    people = np.add.reduceat(transposed @ by_point, first)
    people_slope = np.add.reduceat((transposed @ weighted_residual[..., None])[..., 0], first)
    between = np.add.reduceat(rows.transpose(0, 2, 1) @ by_point, first)
    stiff = 1.0 / (problem.height_spread**2 * problem.redundancy)
    people[:, 2, 2] += stiff
    people_slope[:, 2] += stiff * (parameters.points[:, 2] - problem.height)
    people += 1e-6 * np.eye(3)
    _, prior_slope, prior_curvature = _prior(parameters, problem)
    flat = rows.reshape(-1, rows.shape[2])
    cameras = flat.T @ flat + prior_curvature
    return _System(cameras, flat.T @ weighted_residual.ravel() + prior_slope, people, people_slope, between, by_point)


def _unit(k: int, size: int) -> Floats:
    return np.asarray(np.eye(size)[k])


def _reduced(system: _System, damping: float) -> tuple[Floats, Floats]:
    """The reduced camera system (Schur complement of the points), and the inverse point blocks."""
    people = system.people * (1 + damping * np.eye(3))
    inverse = np.asarray(np.linalg.inv(people), float)
    cameras = system.cameras * (1 + damping * np.eye(len(system.cameras)))
    through = system.between @ inverse
    size = len(cameras)
    flat_through = np.moveaxis(through, 1, 0).reshape(size, -1)
    flat_between = np.moveaxis(system.between, 1, 0).reshape(size, -1)
    return cameras - flat_through @ flat_between.T, inverse


def _stepped(parameters: BundleParameters, system: _System, damping: float) -> BundleParameters:
    reduced, inverse = _reduced(system, damping)
    by_people = np.einsum("nij,njk,nk->i", system.between, inverse, system.people_slope, optimize=True)
    # Nothing fixes the ground's turn and shift: a trace of stiffness keeps them where they are.
    stiff = reduced + 1e-9 * np.diag(np.diag(system.cameras) + 1e-9)
    step = -np.linalg.solve(stiff, system.camera_slope - by_people)
    back = system.people_slope + np.einsum("nij,i->nj", system.between, step)
    points = parameters.points - np.einsum("nij,nj->ni", inverse, back)
    return replace(
        parameters,
        views=parameters.views + step[:-2].reshape(parameters.views.shape),
        toe_offset=parameters.toe_offset + step[-2:],
        points=points,
    )
