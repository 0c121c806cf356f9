"""One robust adjustment of everything: cameras, clocks, and where and how tall people are (METHODS 1).

Each sighting is a foot and a head in a view. Heads are points in space; the lowest point of a silhouette is a little
nearer to the camera than the body's axis, by a length that is adjusted too. Levenberg and Marquardt's steps, people
eliminated first (Triggs et al., Bundle adjustment: a modern synthesis, 2000, section 6.1), weights by Geman and
McClure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.calibration.correspondence import Meetings
from stseg.calibration.pinhole import CENTRE, CLOCK, FOCAL, MIDDLE, RADIAL, SIZE, moved, project

_STEPS = np.array([1e-5] * 5 + [1e-5] * 3 + [1e-4] * 3 + [1e-3])
"""Differences by which a camera's slopes are measured."""
_PRIOR_SPREAD = np.zeros(SIZE)
_PRIOR_SPREAD[FOCAL], _PRIOR_SPREAD[MIDDLE], _PRIOR_SPREAD[RADIAL] = 0.5, 0.01, 0.25
_PRIOR_MEAN = np.zeros(SIZE)
_PRIOR_MEAN[FOCAL], _PRIOR_MEAN[3] = np.log(0.85), -0.15
_TOE_MEAN, _TOE_SPREAD = np.array([0.09, 0.08]), np.array([0.03, 0.04])
_PACE = 1.5
"""m/s at which steps are no longer."""
_OUTLIER = 3.0
"""Standard deviations at which a sighting counts a quarter."""
_ITERATIONS = 40


@dataclass(frozen=True)
class State:
    """What is adjusted.

    Attributes
    ----------
    views : float64 (view, 12)
        See `stseg.calibration.pinhole`.
    toe : float64 (2,)
        Metres by which lowest points are nearer to the camera than axes: of one who stands or walks across, and what
        each m/s towards or away from the camera adds, a step's half.
    points : float64 (n, 3)
        x, y of each person at each moment and the height of the head, metres.
    """

    views: Floats
    toe: Floats
    points: Floats


@dataclass(frozen=True)
class Task:
    """What it is adjusted to.

    Attributes
    ----------
    size : int64 (view, 2)
        Width and height of the images, pixels.
    seen
        People and sightings.
    spread : float64 (m, 2, 2)
        Standard deviation of each sighting's foot and head along and across the body, in lengths of the person.
    height : float64 (n,)
        How tall each meeting's person is expected, metres.
    height_spread
        Its standard deviation.
    alike
        How many sightings say what one independent sighting would: those of one step err alike.
    clock_spread
        Standard deviation of the clocks' differences that are left, seconds.
    body : float64 (m,)
        1 for a sighting of a person; 0 for that of a mark on the floor, which has no toe in front of it. The head of a
        mark has an infinite spread.
    """

    size: Ints
    seen: Meetings
    spread: Floats
    height: Floats
    height_spread: float
    alike: float
    clock_spread: float
    body: Floats


@dataclass(frozen=True)
class Outcome:
    """The adjusted state, how well it is known, and what is left.

    Attributes
    ----------
    state
    covariance : float64 (12 view + 2, 12 view + 2)
        Of the cameras and `toe`, people's own freedom taken into account; the ground's free turn and shift are
        shared out evenly.
    miss : float64 (m, 2, 2)
        Foot and head of each sighting, seen minus expected, along and across the body, in lengths of the person; nan
        behind a camera.
    """

    state: State
    covariance: Floats
    miss: Floats


def adjust(state: State, task: Task) -> Outcome:
    """The most probable state near the given one."""
    damping, cost = 1e-3, _cost(state, task)
    for _ in range(_ITERATIONS):
        system = _system(state, task)
        for _ in range(8):
            moved = _stepped(state, system, damping)
            lower = _cost(moved, task)
            if lower < cost:
                break
            damping *= 6
        else:
            break
        gain, state, cost, damping = cost - lower, moved, lower, max(damping / 6, 1e-9)
        if gain < 1e-5 * cost:
            break
    reduced, _ = _reduced(_system(state, task), 0.0)
    return Outcome(state, _covariance(reduced, state), misses(state, task))


def _covariance(reduced: Floats, state: State) -> Floats:
    """Inverse of the cameras' equations where the ground's turn and shift, and the time, are shared out evenly."""
    free = np.zeros((4, len(reduced)))
    free[3, CLOCK : SIZE * len(state.views) : SIZE] = 1.0
    for k, (turn, shift) in enumerate(((1e-5, (0.0, 0.0)), (0.0, (1e-5, 0.0)), (0.0, (0.0, 1e-5)))):
        changed = np.array([moved(view, turn, np.array(shift), 1.0) for view in state.views])
        free[k, : changed.size] = (changed - state.views).ravel() / 1e-5
    basis = np.linalg.qr(free.T)[0]
    keep = np.eye(len(reduced)) - basis @ basis.T
    stiff = float(np.abs(np.diag(reduced)).max())
    return np.asarray(keep @ np.linalg.inv(keep @ reduced @ keep + stiff * basis @ basis.T) @ keep)


def misses(state: State, task: Task) -> Floats:
    """What each sighting misses, see `Outcome`."""
    return _misses(state.views[task.seen.view], state.toe, state.points[task.seen.point], task)


def _misses(views: Floats, toe: Floats, points: Floats, task: Task) -> Floats:
    seen = task.seen
    width, height = task.size[seen.view].T.astype(float)
    velocity = seen.velocity[seen.point]
    place = points.copy()
    place[:, :2] -= views[:, CLOCK, None] * velocity
    toward = views[:, CENTRE][:, :2] - place[:, :2]
    toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-6)
    forward = toe[0] + toe[1] * np.minimum(np.abs((toward * velocity).sum(axis=1)), _PACE)
    forward *= task.body
    low = np.column_stack([place[:, :2] + forward[:, None] * toward, np.zeros(len(place))])
    down = seen.foot - seen.head
    square = (down**2).sum(axis=1)[:, None]
    foot = seen.foot - project(views, width, height, low)
    head = seen.head - project(views, width, height, place)
    across = np.stack([-down[:, 1], down[:, 0]], -1)
    return np.asarray(
        np.stack([[(end * way).sum(axis=1) for way in (down, across)] for end in (foot, head)]).transpose(2, 0, 1)
        / (square[..., None])
    )


def _squares(miss: Floats, task: Task) -> Floats:
    """Squared standard deviations that each end is off, float64 (m, 2)."""
    return np.asarray(((np.nan_to_num(miss, nan=1e3) / task.spread) ** 2).sum(axis=2))


def _cost(state: State, task: Task) -> float:
    square = _squares(misses(state, task), task)
    robust = (square / (1.0 + square / _OUTLIER**2)).sum() / task.alike
    heights = (((state.points[:, 2] - task.height) / task.height_spread) ** 2).sum()
    return float(robust + heights / task.alike + _prior(state, task)[0])


def _prior(state: State, task: Task) -> tuple[float, Floats, Floats]:
    """Cost, half its gradient and half its curvature, of what cameras and feet are like."""
    known = _PRIOR_SPREAD > 0
    weight = np.where(known, 1.0 / np.where(known, _PRIOR_SPREAD, 1.0) ** 2, 0.0)
    weight[CLOCK] = task.clock_spread**-2
    matrix = np.diag(np.append(np.tile(weight, len(state.views)), _TOE_SPREAD**-2))
    off = np.append((state.views - _PRIOR_MEAN).ravel(), state.toe - _TOE_MEAN)
    slope = matrix @ off
    return float(off @ slope), slope, matrix


@dataclass(frozen=True)
class _System:
    """Normal equations: of cameras, of people, and between them."""

    cameras: Floats
    camera_slope: Floats
    people: Floats
    people_slope: Floats
    between: Floats


def _system(state: State, task: Task) -> _System:
    seen = task.seen
    of_view, of_point = state.views[seen.view], state.points[seen.point]
    miss = _misses(of_view, state.toe, of_point, task)
    ahead: Flags = np.asarray(np.isfinite(miss).all(axis=(1, 2)))
    weight = np.where(ahead[:, None], (1.0 + _squares(miss, task) / _OUTLIER**2) ** -2, 0.0)
    root = (np.sqrt(weight / task.alike)[..., None] / task.spread).reshape(-1, 4)

    def slope(views: Floats, toe: Floats, points: Floats, step: float) -> Floats:
        changed = (_misses(views, toe, points, task) - miss).reshape(-1, 4) / step
        return np.where(np.isfinite(changed), changed, 0.0) * root

    by_view = np.stack([slope(of_view + h * _unit(k, SIZE), state.toe, of_point, h) for k, h in enumerate(_STEPS)], -1)
    by_toe = np.stack([slope(of_view, state.toe + 1e-4 * _unit(k, 2), of_point, 1e-4) for k in range(2)], -1)
    by_point = np.stack([slope(of_view, state.toe, of_point + 1e-4 * _unit(k, 3), 1e-4) for k in range(3)], -1)
    left = np.nan_to_num(miss.reshape(-1, 4)) * root
    rows = np.zeros((len(miss), 4, SIZE * len(state.views) + len(state.toe)))
    columns = SIZE * seen.view[:, None] + np.arange(SIZE)
    np.put_along_axis(rows, np.repeat(columns[:, None], 4, axis=1), by_view, axis=2)
    rows[:, :, -2:] = by_toe
    return _normal(state, task, rows, by_point, left)


def _normal(state: State, task: Task, rows: Floats, by_point: Floats, left: Floats) -> _System:
    """Normal equations from weighted slopes and misses; sightings of one meeting stand together."""
    first = np.flatnonzero(np.diff(task.seen.point, prepend=-1))
    transposed = by_point.transpose(0, 2, 1)
    people = np.add.reduceat(transposed @ by_point, first)
    people_slope = np.add.reduceat((transposed @ left[..., None])[..., 0], first)
    between = np.add.reduceat(rows.transpose(0, 2, 1) @ by_point, first)
    stiff = 1.0 / (task.height_spread**2 * task.alike)
    people[:, 2, 2] += stiff
    people_slope[:, 2] += stiff * (state.points[:, 2] - task.height)
    people += 1e-6 * np.eye(3)
    _, prior_slope, prior_curvature = _prior(state, task)
    flat = rows.reshape(-1, rows.shape[2])
    cameras = flat.T @ flat + prior_curvature
    return _System(cameras, flat.T @ left.ravel() + prior_slope, people, people_slope, between)


def _unit(k: int, size: int) -> Floats:
    return np.asarray(np.eye(size)[k])


def _reduced(system: _System, damping: float) -> tuple[Floats, Floats]:
    """The cameras' equations with people eliminated (Schur's complement), and people's inverse blocks."""
    people = system.people * (1 + damping * np.eye(3))
    inverse = np.asarray(np.linalg.inv(people), float)
    cameras = system.cameras * (1 + damping * np.eye(len(system.cameras)))
    through = system.between @ inverse
    size = len(cameras)
    flat_through = np.moveaxis(through, 1, 0).reshape(size, -1)
    flat_between = np.moveaxis(system.between, 1, 0).reshape(size, -1)
    return cameras - flat_through @ flat_between.T, inverse


def _stepped(state: State, system: _System, damping: float) -> State:
    reduced, inverse = _reduced(system, damping)
    by_people = np.einsum("nij,njk,nk->i", system.between, inverse, system.people_slope, optimize=True)
    # Nothing fixes the ground's turn and shift: a trace of stiffness keeps them where they are.
    stiff = reduced + 1e-9 * np.diag(np.diag(system.cameras) + 1e-9)
    step = -np.linalg.solve(stiff, system.camera_slope - by_people)
    back = system.people_slope + np.einsum("nij,i->nj", system.between, step)
    points = state.points - np.einsum("nij,nj->ni", inverse, back)
    return replace(
        state,
        views=state.views + step[:-2].reshape(state.views.shape),
        toe=state.toe + step[-2:],
        points=points,
    )
