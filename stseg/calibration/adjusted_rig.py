"""The rig that an adjustment amounts to, and what it says of each view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.calibration.pinhole import CENTRE, CLOCK, FOCAL, SIZE, as_camera, height_of_head, moved, on_plane
from stseg.calibration.solution import Solution
from stseg.geometry import Camera, Grid

_MARGIN = 0.5
"""Metres of ground around where people walked."""


@dataclass(frozen=True)
class ViewReport:
    """How well one view fits the others.

    Attributes
    ----------
    sightings
        People and frames in which it and another view saw somebody.
    foot_pixels, head_pixels
        Median distances of feet and heads from where the adjusted people have them.
    ground_metres
        Median distance of its people's feet on the ground from where all views together have them.
    head_metres
        Median difference of its heads' heights from those that all views together have.
    focal, focal_spread
        Pixels, and standard deviation.
    centre_spread
        Standard deviation of the camera's place, metres.
    clock, clock_spread
        What is left of its delay beyond whole frames, and standard deviation, seconds.
    """

    sightings: int
    foot_pixels: float
    head_pixels: float
    ground_metres: float
    head_metres: float
    focal: float
    focal_spread: float
    centre_spread: float
    clock: float
    clock_spread: float


def scaled(solution: Solution, factor: float) -> Solution:
    """The same with all lengths on the ground multiplied."""
    state = solution.outcome.state
    views = np.array([moved(view, 0.0, np.zeros(2), factor) for view in state.views])
    state = replace(state, views=views, toe=factor * state.toe, points=factor * state.points)
    scale = np.ones(len(solution.outcome.covariance))
    for view in range(len(views)):
        scale[SIZE * view + CENTRE.start : SIZE * view + CENTRE.stop] = factor
    scale[-2:] = factor
    covariance = scale[:, None] * solution.outcome.covariance * scale
    seen = solution.task.seen
    seen = replace(seen, ground=factor * seen.ground, velocity=factor * seen.velocity)
    outcome = replace(solution.outcome, state=state, covariance=covariance)
    return replace(solution, outcome=outcome, task=replace(solution.task, seen=seen))


def centred(solution: Solution) -> Solution:
    """The same on a ground whose origin is the middle of where people walked, x along the first camera's right."""
    state = solution.outcome.state
    middle = (state.points[:, :2].max(axis=0) + state.points[:, :2].min(axis=0)) / 2
    toward = middle - state.views[0, CENTRE][:2]
    turn = np.pi / 2 - float(np.arctan2(toward[1], toward[0]))
    about = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    views = np.array([moved(view, turn, -about @ middle, 1.0) for view in state.views])
    points = np.column_stack([(state.points[:, :2] - middle) @ about.T, state.points[:, 2]])
    state = replace(state, views=views, points=points)
    seen = solution.task.seen
    seen = replace(seen, ground=(seen.ground - middle) @ about.T, velocity=seen.velocity @ about.T)
    return replace(solution, outcome=replace(solution.outcome, state=state), task=replace(solution.task, seen=seen))


def distance_factor(solution: Solution, view: int, pixels: Floats, metres: float) -> float:
    """By what all lengths grow so that two ground pixels (2, 2) of a view are so far apart; nan above the horizon."""
    camera = solution.outcome.state.views[view]
    ground = on_plane(camera, _size(solution, view), pixels, 0.0)
    return metres / float(np.linalg.norm(ground[1] - ground[0]))


def cameras_of(solution: Solution, names: Sequence[str]) -> tuple[Camera, ...]:
    """The cameras, as a rig has them."""
    return tuple(
        as_camera(view, name, _size(solution, k))
        for k, (name, view) in enumerate(zip(names, solution.outcome.state.views, strict=True))
    )


def offsets_of(solution: Solution) -> Ints:
    """Each stream's offset of the rig file; none is above 0, so that all are there at the recording's first frame."""
    return np.asarray(solution.delay.min() - solution.delay)


def grid_of(solution: Solution, cell: float) -> Grid:
    """A grid over where people walked."""
    ground = solution.outcome.state.points[:, :2]
    low = np.floor((np.percentile(ground, 1, axis=0) - _MARGIN) / cell) * cell
    high = np.ceil((np.percentile(ground, 99, axis=0) + _MARGIN) / cell) * cell
    x, y = np.round(np.stack([low, high], 1), 6).tolist()
    return Grid((x[0], x[1]), (y[0], y[1]), cell)


def reports_of(solution: Solution) -> list[ViewReport]:
    """How well each view fits the others."""
    return [_report(solution, view) for view in range(len(solution.delay))]


def _report(solution: Solution, view: int) -> ViewReport:
    outcome, seen = solution.outcome, solution.task.seen
    state, size = outcome.state, _size(solution, view)
    rows = np.flatnonzero(seen.view == view)
    length = np.hypot(*(seen.foot[rows] - seen.head[rows]).T)
    missed = np.linalg.norm(outcome.miss[rows], axis=2) * length[:, None]
    points = state.points[seen.point[rows]]
    camera = state.views[view]
    toward = camera[CENTRE][:2] - points[:, :2]
    low = points[:, :2] + state.toe[0] * toward / np.linalg.norm(toward, axis=1, keepdims=True)
    away = np.linalg.norm(on_plane(camera, size, seen.foot[rows], 0.0) - low, axis=1)
    tall = height_of_head(camera, size, seen.head[rows], points[:, :2])
    focal = size[0] * float(np.exp(camera[FOCAL]))
    spread = np.sqrt(np.maximum(np.diag(outcome.covariance)[SIZE * view : SIZE * (view + 1)], 0.0))
    return ViewReport(
        sightings=len(rows),
        foot_pixels=float(np.nanmedian(missed[:, 0])),
        head_pixels=float(np.nanmedian(missed[:, 1])),
        ground_metres=float(np.nanmedian(away)),
        head_metres=float(np.nanmedian(np.abs(tall - points[:, 2]))),
        focal=focal,
        focal_spread=focal * float(spread[FOCAL]),
        centre_spread=float(np.linalg.norm(spread[CENTRE])),
        clock=float(camera[CLOCK]),
        clock_spread=float(spread[CLOCK]),
    )


def _size(solution: Solution, view: int) -> tuple[int, int]:
    width, height = solution.task.size[view].tolist()
    return width, height
