"""From the ends of walking people in every view to cameras on one ground."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.calibration.bundle_adjustment import Outcome, State, Task, adjust
from stseg.calibration.correspondence import Meetings, meetings
from stseg.calibration.endpoint_paths import path_of
from stseg.calibration.endpoints import Ends
from stseg.calibration.floor_features import Marks
from stseg.calibration.pinhole import CLOCK, height_of_head, moved
from stseg.calibration.single_view import FORWARD, axis_of_foot, view_of_upright
from stseg.calibration.view_alignment import Alignment, Walks
from stseg.calibration.view_merging import Assembly

_GATES = (0.8, 0.6, 0.5, 0.5, 0.5)
"""Metres within which feet of several views may be one person's, round after round."""
ROUNDS = len(_GATES)
_MOST_POINTS = 1200
_HEIGHTS = 0.08
"""Standard deviation of a head's height among people, metres."""
_BOB = 0.03
"""The same of one person who walks."""
_LEAST_SPREAD = np.array([[0.02, 0.02], [0.004, 0.003]])
"""Of feet and heads, along and across, in lengths of a person, however well they seem to fit."""
_TRACE = 0.3
"""Pixels below which no end is known."""
_CLOCKS, _SAME_CLOCK = 0.2, 1e-4
"""Standard deviations of what is left of unknown and of known delays, seconds."""
_MOST_MARKS = 800
_MARK_PIXELS = 1.5
"""Standard deviation of a mark on the floor, pixels: it is found in a plan, where distant ground is stretched."""
_STEP_SECONDS = 0.5
"""A step's time, in which ends err alike."""


@dataclass(frozen=True)
class Views:
    """What each camera is known by before anything is calibrated.

    Attributes
    ----------
    ends
        Of isolated people, one a camera.
    sizes
        Width and height of the images, pixels.
    frame_rate
        Frames per second of all.
    person_height
        How tall people are on the average, metres.
    most_delay
        Seconds by which one stream may be late, at most; 0 where all are known to run together.
    """

    ends: tuple[Ends, ...]
    sizes: tuple[tuple[int, int], ...]
    frame_rate: float
    person_height: float
    most_delay: float


@dataclass(frozen=True)
class Solution:
    """Cameras on one ground.

    Attributes
    ----------
    outcome
        The last adjustment.
    task
        What it was adjusted to.
    delay : int64 (view,)
        A stream's own frame = the recording's frame + delay.
    """

    outcome: Outcome
    task: Task
    delay: Ints


def views_alone(views: Views, progress: Callable[[], None]) -> list[Floats]:
    """Each view on a ground of its own, float64 (12,)."""
    alone = []
    for ends, size in zip(views.ends, views.sizes, strict=True):
        alone.append(view_of_upright(ends, size, views.person_height)[0])
        progress()
    return alone


def walks_of(views: Views, alone: Sequence[Floats]) -> list[Walks]:
    """Each view's people on its own ground."""
    walks = []
    for ends, size, view in zip(views.ends, views.sizes, alone, strict=True):
        place = axis_of_foot(view, size, ends.foot, FORWARD)
        walks.append(Walks(ends.frame, place[:, 0] + 1j * place[:, 1], path_of(ends, views.frame_rate)))
    return walks


def placed_views(alone: Sequence[Floats], assembly: Assembly) -> Floats:
    """All views on the ground of the first that was placed, float64 (view, 12)."""
    return np.array([_placed(view, assembly.placed[k]) for k, view in enumerate(alone)])


def _placed(view: Floats, way: Alignment) -> Floats:
    back = way.inverse
    shift = np.array([back.shift.real, back.shift.imag])
    return moved(view, float(np.angle(back.factor)), shift, abs(back.factor))


def refine(views: Views, start: Floats, delay: Ints, progress: Callable[[], None]) -> Solution:
    """Who is who and one adjustment of everything, in turns, until both are settled.

    Parameters
    ----------
    views
        What is known.
    start : float64 (view, 12)
        The cameras, roughly.
    delay : int64 (view,)
        A stream's own frame = the recording's frame + delay, roughly.
    progress
        Told after each turn.
    """
    state = State(start, np.array([FORWARD, 0.0]), np.zeros((0, 3)))
    spread = np.array([[0.07, 0.05], [0.03, 0.03]])
    for gate in _GATES:
        clock = state.views[:, CLOCK] - np.median(state.views[:, CLOCK])
        late = np.rint(clock * views.frame_rate).astype(np.int64)
        delay = delay + late - late[0]
        state.views[:, CLOCK] -= late / views.frame_rate
        solution = _turn(views, state, delay, gate, spread)
        state = solution.outcome.state
        spread = _spread(solution)
        progress()
    return solution


def _turn(views: Views, state: State, delay: Ints, gate: float, spread: Floats) -> Solution:
    ground = [
        axis_of_foot(view, size, ends.foot, float(state.toe[0] + 0.5 * state.toe[1]))
        for view, size, ends in zip(state.views, views.sizes, views.ends, strict=True)
    ]
    met = meetings(views.ends, delay, ground, gate, views.frame_rate)
    met = met.of(_spread_out(met))
    known = len(state.points) > 0
    height = _heights(views, state, met) if known else np.full(len(met.frame), views.person_height)
    task = Task(
        np.array(views.sizes),
        met,
        _floored(met, spread),
        height,
        _BOB if known else _HEIGHTS,
        _alike(met, views),
        _CLOCKS if views.most_delay else _SAME_CLOCK,
        np.ones(len(met.view)),
    )
    points = np.column_stack([met.ground, height])
    return Solution(adjust(State(state.views, state.toe, points), task), task, delay)


def refine_with_marks(views: Views, solution: Solution, marks: Marks) -> Solution:
    """The adjustment again, with marks on the floor that two views share beside the people."""
    if not len(marks):
        return solution
    task, state = solution.task, solution.outcome.state
    some = marks.of(np.unique(np.linspace(0, len(marks) - 1, min(_MOST_MARKS, len(marks))).astype(np.int64)))
    joint = _with_marks(task, some)
    points = np.concatenate([state.points, np.column_stack([some.ground, np.full(len(some), views.person_height)])])
    outcome = adjust(replace(state, points=points), joint)
    people, sightings = len(state.points), len(task.seen.view)
    state = replace(outcome.state, points=outcome.state.points[:people])
    return Solution(replace(outcome, state=state, miss=outcome.miss[:sightings]), task, solution.delay)


def _with_marks(task: Task, marks: Marks) -> Task:
    """The same task with two sightings of each mark, whose feet alone count."""
    seen, count = task.seen, len(marks)
    pixel = marks.pixel.reshape(-1, 2)
    foot = np.array([_MARK_PIXELS * np.sqrt(task.alike)] * 2)
    met = Meetings(
        np.concatenate([seen.frame, np.zeros(count, np.int64)]),
        np.concatenate([seen.ground, marks.ground]),
        np.concatenate([seen.velocity, np.zeros((count, 2))]),
        np.concatenate([seen.person, np.full(count, -1, np.int64)]),
        np.concatenate([seen.point, len(seen.frame) + np.repeat(np.arange(count), 2)]),
        np.concatenate([seen.view, marks.view.ravel()]),
        np.concatenate([seen.foot, pixel]),
        np.concatenate([seen.head, pixel - [0.0, 1.0]]),  # a person one pixel tall: lengths are pixels
    )
    return replace(
        task,
        seen=met,
        spread=np.concatenate([task.spread, np.tile([foot, [np.inf, np.inf]], (2 * count, 1, 1))]),
        height=np.concatenate([task.height, np.full(count, float(task.height.mean()))]),
        body=np.concatenate([task.body, np.zeros(2 * count)]),
    )


def _spread_out(met: Meetings) -> Ints:
    """Meetings to adjust to, spread over all frames."""
    return np.unique(np.linspace(0, len(met.frame) - 1, min(_MOST_POINTS, len(met.frame))).astype(np.int64))


def _heights(views: Views, state: State, met: Meetings) -> Floats:
    """How tall each meeting's person is, from the heads of all of that person's meetings, float64 (n,) metres."""
    sightings: list[list[float]] = [[] for _ in range(int(met.person.max(initial=-1)) + 1)]
    for view, (size, camera) in enumerate(zip(views.sizes, state.views, strict=True)):
        rows = np.flatnonzero(met.view == view)
        tall = height_of_head(camera, size, met.head[rows], met.ground[met.point[rows]])
        for person, metres in zip(met.person[met.point[rows]], tall, strict=True):
            sightings[person].append(metres)
    mean = np.array([np.nanmedian(several) if np.isfinite(several).any() else np.nan for several in sightings])
    count = np.array([np.isfinite(several).sum() for several in sightings])
    # Few sightings say little: people are about as tall as people are.
    share = count / (count + 20.0)
    tall = np.where(np.isfinite(mean), share * mean + (1 - share) * views.person_height, views.person_height)
    weight = count[met.person] / np.maximum(np.bincount(met.person)[met.person], 1)
    tall *= views.person_height / np.average(tall[met.person], weights=np.maximum(weight, 1e-9))
    return np.asarray(tall[met.person])


def _alike(met: Meetings, views: Views) -> float:
    """How many meetings of a person fall into one step."""
    frames = max(len(np.unique(met.frame)), 1)
    rate = views.frame_rate * frames / max(int(np.ptp(met.frame)) + 1 if len(met.frame) else 1, 1)
    return max(1.0, rate * _STEP_SECONDS)


def _floored(met: Meetings, spread: Floats) -> Floats:
    """Standard deviations of each sighting's ends, in lengths of a person, none below what a pixel shows."""
    length = np.hypot(*(met.foot - met.head).T)
    return np.asarray(np.maximum(spread, (_TRACE / length)[:, None, None]))


def _spread(solution: Solution) -> Floats:
    """Spread of feet and heads along and across, in lengths of a person, by the median of what was missed.

    Three numbers of each person and moment were chosen so that little is missed, which is taken into account.
    """
    miss = solution.outcome.miss
    free = 1.0 - 3 * len(solution.outcome.state.points) / max(4 * len(miss), 1)
    return np.asarray(np.maximum(1.4826 * np.nanmedian(np.abs(miss), axis=0) / np.sqrt(free), _LEAST_SPREAD))
