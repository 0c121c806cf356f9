"""Alternation of correspondence and bundle adjustment: endpoints of all views to cameras on one ground."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats, Ints, even_rows
from stseg.calibration.automatic.correspondence import Correspondences, match_endpoints
from stseg.calibration.automatic.endpoints import Endpoints
from stseg.calibration.automatic.floor_features import Marks
from stseg.calibration.automatic.single_view import FORWARD, axis_of_foot, view_of_upright
from stseg.calibration.automatic.view_alignment import ViewPlaces
from stseg.calibration.bundle_adjustment import Adjustment, BundleParameters, BundleProblem, adjust, same_make
from stseg.calibration.pinhole import CLOCK, height_of_head

_GATES = (0.8, 0.6, 0.5, 0.5, 0.5)
"""Correspondence gate of each round, metres."""
ROUNDS = len(_GATES)
_MAX_POINTS = 1200
_HEIGHT_SPREAD = 0.08
"""Standard deviation of body height between people, metres."""
_HEAD_SPREAD = 0.03
"""Standard deviation of the head height of one walking person, metres."""
_UNSEEN_OBSERVATIONS, _UNSEEN_POINTS, _HEIGHT_ROUNDS = 20.0, 5.0, 4
"""Observations of one body's height, or points, that the mean of all is worth; adjustments by heights of points."""
_MIN_SPREAD = np.array([[0.02, 0.01], [0.004, 0.01]])
"""Least standard deviations of feet and heads, along and across, in body lengths."""
_MIN_FREEDOM = 0.1
"""Share of a residual's variance below which it says nothing of its spread."""
_MIN_PIXEL_SPREAD = 0.3
"""Least standard deviation of an endpoint, pixels."""
_CLOCK_SPREAD, _SYNCHRONOUS_SPREAD = 0.2, 1e-4
"""Standard deviations of residual clock offsets, of unknown and of known delays, seconds."""
_OWN_FRAME = 0.25
"""Residual delay from which the next frame is tried, frames."""
_MAX_MARKS = 800
"""Number of floor features at most."""
_MARK_PIXELS = 1.5
"""Standard deviation of a floor feature, pixels: it is located in a plan, where distant ground is stretched."""
_STEP_SECONDS = 0.5
"""Duration of a step, within which endpoint errors are correlated, seconds."""


@dataclass(frozen=True)
class CalibrationInput:
    """Input of the calibration from people."""

    endpoints: tuple[Endpoints, ...]
    """Endpoints of isolated people, one entry a camera."""
    sizes: tuple[tuple[int, int], ...]
    """Width and height of the images, pixels."""
    frame_rate: float
    """Frames per second of all streams."""
    person_height: float
    """Mean body height, metres."""
    most_delay: float
    """Greatest delay of one stream against another, seconds; 0 where all are synchronous."""


@dataclass(frozen=True)
class SolvedViews:
    """Cameras on one ground."""

    adjustment: Adjustment
    """Result of the last adjustment."""
    problem: BundleProblem
    """Its observations."""
    delay: Ints
    """int64 (view,): a stream's own frame = the recording's frame + delay."""


def single_view_cameras(views: CalibrationInput, progress: Callable[[], None]) -> list[Floats]:
    """Self-calibrate each view on a ground of its own, float64 (14,) each."""
    single_cameras = []
    for endpoints, size in zip(views.endpoints, views.sizes, strict=True):
        single_cameras.append(view_of_upright(endpoints, size, views.person_height)[0])
        progress()
    return single_cameras


def view_places(views: CalibrationInput, single_cameras: Sequence[Floats]) -> list[ViewPlaces]:
    """Ground points of each view's people, on its own ground."""
    cameras, axes = zip(views.endpoints, views.sizes, single_cameras, strict=True), np.array([1, 1j])
    return [ViewPlaces(one.frame, axis_of_foot(view, size, one.foot, FORWARD) @ axes) for one, size, view in cameras]


def refine_cameras(views: CalibrationInput, start: Floats, delay: Ints, progress: Callable[[], None]) -> SolvedViews:
    """Alternate correspondence and bundle adjustment, with shrinking gates.

    Parameters
    ----------
    views
        Endpoints and image sizes.
    start : float64 (view, 14)
        Initial cameras.
    delay : int64 (view,)
        Initial delays: a stream's own frame = the recording's frame + delay.
    progress
        Called after each round.
    """
    parameters = BundleParameters(start, np.array([FORWARD, 0.0]), np.zeros((0, 3)))
    spread = np.array([[0.07, 0.05], [0.03, 0.03]])
    for gate in _GATES:
        solution = _round(views, parameters, delay, gate, spread)
        for side in (1, -1):  # views that are late, then those that are early: both would meet at the other's place
            later = side * np.maximum(np.ceil(side * _clock_frames(solution, views) - _OWN_FRAME), 0)
            if views.most_delay and later.any():
                solution = _at_other_delay(views, solution, later.astype(np.int64), gate, spread)
        delay, parameters, spread = solution.delay, solution.adjustment.parameters, _residual_spread(solution)
        progress()
    for _ in range(_HEIGHT_ROUNDS):
        solution = _by_own_heights(views, solution)
    return replace(solution, delay=delay - delay[0])


def _by_own_heights(views: CalibrationInput, solution: SolvedViews) -> SolvedViews:
    """Adjust again by the heights that were found: those by feet alone make people seem larger here than there."""
    matched, points = solution.problem.correspondences, solution.adjustment.parameters.points
    problem = replace(solution.problem, height=_shrunk(views, matched, matched.person, points[:, 2], _UNSEEN_POINTS))
    return replace(solution, problem=problem, adjustment=adjust(solution.adjustment.parameters, problem))


def _clock_frames(solution: SolvedViews, views: CalibrationInput) -> Floats:
    """Residual delay of each view against the others, frames."""
    clock = solution.adjustment.parameters.views[:, CLOCK]
    return np.asarray((clock - np.median(clock)) * views.frame_rate)


def _at_other_delay(
    views: CalibrationInput, solution: SolvedViews, later: Ints, gate: float, spread: Floats
) -> SolvedViews:
    """The round at delays so many frames later, where residual delays are smaller there.

    They are estimated too small: people who are matched a frame apart meet half way.
    """
    parameters = solution.adjustment.parameters
    clock = parameters.views.copy()
    clock[:, CLOCK] -= later / views.frame_rate
    other = _round(views, replace(parameters, views=clock), solution.delay + later, gate, spread)
    before, after = (np.abs(_clock_frames(one, views)).sum() for one in (solution, other))
    return other if after < before else solution


def _round(
    views: CalibrationInput, parameters: BundleParameters, delay: Ints, gate: float, spread: Floats
) -> SolvedViews:
    ground = [
        axis_of_foot(view, size, endpoints.foot, float(parameters.toe_offset[0] + 0.5 * parameters.toe_offset[1]))
        for view, size, endpoints in zip(parameters.views, views.sizes, views.endpoints, strict=True)
    ]
    matched = match_endpoints(views.endpoints, delay, ground, gate, views.frame_rate)
    matched = matched.of(even_rows(len(matched.frame), _MAX_POINTS))
    refined = len(parameters.points) > 0
    height = _heights(views, parameters, matched) if refined else np.full(len(matched.frame), views.person_height)
    length = np.hypot(*(matched.foot - matched.head).T)
    problem = BundleProblem(
        np.array(views.sizes),
        matched,
        np.maximum(spread, (_MIN_PIXEL_SPREAD / length)[:, None, None]),
        height,
        _HEAD_SPREAD if refined else _HEIGHT_SPREAD,
        _redundancy(matched, views),
        _CLOCK_SPREAD if views.most_delay else _SYNCHRONOUS_SPREAD,
        same_make(parameters.views, np.array(views.sizes)),
        np.ones(len(matched.view)),
    )
    start = replace(parameters, points=np.column_stack([matched.ground, height]))
    return SolvedViews(adjust(start, problem), problem, delay)


def refine_with_marks(views: CalibrationInput, solution: SolvedViews, marks: Marks) -> SolvedViews:
    """Repeat the adjustment with floor features as additional points."""
    if not len(marks):
        return solution
    problem, parameters = solution.problem, solution.adjustment.parameters
    fine = marks.of(even_rows(len(marks), _MAX_MARKS))
    joint = _with_marks(problem, fine)
    places = np.column_stack([fine.ground, np.full(len(fine), views.person_height)])
    adjustment = adjust(replace(parameters, points=np.concatenate([parameters.points, places])), joint)
    people, observations = len(parameters.points), len(problem.correspondences.view)
    parameters = replace(adjustment.parameters, points=adjustment.parameters.points[:people])
    adjustment = replace(adjustment, parameters=parameters, residual=adjustment.residual[:observations])
    return replace(solution, adjustment=adjustment)


def _with_marks(problem: BundleProblem, marks: Marks) -> BundleProblem:
    """The problem with two observations of each floor feature, of which only the foot has weight."""
    correspondences, count = problem.correspondences, len(marks)
    pixel = marks.pixel.reshape(-1, 2)
    foot = np.array([_MARK_PIXELS * np.sqrt(problem.redundancy)] * 2)
    extended = Correspondences(
        np.concatenate([correspondences.frame, np.zeros(count, np.int64)]),
        np.concatenate([correspondences.ground, marks.ground]),
        np.concatenate([correspondences.velocity, np.zeros((count, 2))]),
        np.concatenate([correspondences.person, np.full(count, -1, np.int64)]),
        np.concatenate([correspondences.point, len(correspondences.frame) + np.repeat(np.arange(count), 2)]),
        np.concatenate([correspondences.view, marks.view.ravel()]),
        np.concatenate([correspondences.foot, pixel]),
        np.concatenate([correspondences.head, pixel - [0.0, 1.0]]),  # a person one pixel tall: lengths are pixels
    )
    return replace(
        problem,
        correspondences=extended,
        spread=np.concatenate([problem.spread, np.tile([foot, [np.inf, np.inf]], (2 * count, 1, 1))]),
        height=np.concatenate([problem.height, np.full(count, float(problem.height.mean()))]),
        body=np.concatenate([problem.body, np.zeros(2 * count)]),
    )


def _heights(views: CalibrationInput, parameters: BundleParameters, matched: Correspondences) -> Floats:
    """Body height of each point's track by feet and heads, metres, float64 (n,)."""
    metres = np.zeros(len(matched.view))
    for view, (size, camera) in enumerate(zip(views.sizes, parameters.views, strict=True)):
        rows = matched.view == view
        metres[rows] = height_of_head(camera, size, matched.head[rows], matched.ground[matched.point[rows]])
    return _shrunk(views, matched, matched.person[matched.point], metres, _UNSEEN_OBSERVATIONS)


def _shrunk(views: CalibrationInput, matched: Correspondences, person: Ints, metres: Floats, unseen: float) -> Floats:
    """Median height of each point's track, by half towards the mean of all where it is seen as often as `unseen`."""
    several = [metres[(person == k) & np.isfinite(metres)] for k in range(int(person.max(initial=-1)) + 1)]
    share = np.array([len(one) / (len(one) + unseen) for one in several])
    median = np.array([np.median(one) if len(one) else views.person_height for one in several])
    height = (share * median + (1 - share) * views.person_height)[matched.person]
    return np.asarray(height * views.person_height / height.mean())


def _redundancy(matched: Correspondences, views: CalibrationInput) -> float:
    """Observations of a person within one step."""
    frames = max(len(np.unique(matched.frame)), 1)
    rate = views.frame_rate * frames / max(int(np.ptp(matched.frame)) + 1 if len(matched.frame) else 1, 1)
    return max(1.0, rate * _STEP_SECONDS)


def _residual_spread(solution: SolvedViews) -> Floats:
    """Robust standard deviation of feet and heads along and across, in body lengths, of studentised residuals.

    Feet and heads have one spread across: a walker's head is not above the feet, and two views of either explain
    themselves, so that the adjustment could believe one end alone.
    """
    adjustment = solution.adjustment
    studentised = np.abs(adjustment.residual) / np.sqrt(np.maximum(adjustment.freedom, _MIN_FREEDOM))
    spread = np.nanmedian(studentised, axis=0)
    spread[:, 1] = np.nanmedian(studentised[..., 1])
    return np.asarray(np.maximum(1.4826 * spread, _MIN_SPREAD))
