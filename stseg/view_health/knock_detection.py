"""Change detection for a camera that was knocked while it recorded, and views that are wrong throughout.

Input is an agreement score of each frame and view, higher is better: either the shift of the view's background
(`stseg.view_health.image_shifts`), which shows a knock of a pixel, or its residual against the other views, which
needs no picture but a larger knock. A knock is a downward step of one view's score relative to the median of the
others: where all fall at once, the scene changed (a crowd, the light).

The residuals are those of the detector (`reprojection_residuals`), window by window. A wrong view draws detections
towards itself: its residual understates its error. Views along the same line of sight get residuals too. With three
views, or two that face each other, positions cannot decide which is wrong; all views as far off are reported.
"""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats

_LEAST_FRAMES = 20
"""Least number of scored frames on either side of a step."""
_STEP_ERRORS = 6.0
"""Least size of a step, in its standard errors."""
_STEP_DEVIATIONS = 1.0
"""Least size of a step, in standard deviations of single frames; smaller ones are harmless."""
_LEAST_WINDOWS = 5
"""Windows with a residual that a view needs."""
_RESIDUAL_ERRORS = 3.0
"""Least residual in standard errors."""
_REPORTED_SHARE = 0.6
"""Share of the largest residual from which a view is reported too."""


@dataclass(frozen=True)
class Knock:
    """A downward step of a view's agreement."""

    view: int
    """Index of the view."""
    frame: int
    """Index of the first frame after the knock."""
    before: float
    after: float
    """Median score on either side, in the unit of the input."""
    errors: float
    """Size of the step in standard errors."""


def find_knocks(agreement: Floats, least: float = 0.0) -> list[Knock]:
    """Find knocked views, each once at its clearest step, in the order of the views.

    Parameters
    ----------
    agreement : float64 (frame, view)
        Agreement of each view in each frame, higher is better; nan where there is no measurement.
    least
        Smallest step that matters, in the unit of `agreement`, such as half a pixel.
    """
    found = [_step(agreement, view, least) for view in range(agreement.shape[1])]
    return [knock for knock in found if knock is not None]


def _step(agreement: Floats, view: int, least: float) -> Knock | None:
    relative = agreement[:, view] - _median(np.delete(agreement, view, axis=1))
    rows = np.flatnonzero(np.isfinite(relative))
    if len(rows) < 2 * _LEAST_FRAMES:
        return None
    # Outlier frames must not look like steps.
    centre, wide = np.median(relative[rows]), 6 * _spread(relative[rows]) or np.inf
    values = np.clip(relative[rows], centre - wide, centre + wide)
    cut = _cut(values)
    before, after = values[:cut], values[cut:]
    residual = np.concatenate([before - before.mean(), after - after.mean()])
    step, spread = float(before.mean() - after.mean()), max(float(residual.std()), 1e-9)
    errors = step / (spread * np.sqrt(_frames_per_sample(residual) * (1 / len(before) + 1 / len(after))))
    # The clipped scores decide significance, the medians the size of the step.
    drop = float(np.median(relative[rows][:cut]) - np.median(relative[rows][cut:]))
    if errors < _STEP_ERRORS or step < _STEP_DEVIATIONS * spread or drop < least:
        return None
    sound, low = (float(np.median(part)) for part in np.split(agreement[rows, view], [cut]))
    if sound - low < drop / 2:  # rather, the others have risen
        return None
    return Knock(view, int(rows[cut]), sound, low, float(errors))


def _cut(values: Floats) -> int:
    """Change point: number of values before it in the best fit of two levels, the first the higher."""
    count = np.arange(_LEAST_FRAMES, len(values) - _LEAST_FRAMES + 1)
    total = np.concatenate([[0.0], np.cumsum(values)])
    before, after = total[count] / count, (total[-1] - total[count]) / (len(values) - count)
    return int(count[np.argmax((before - after) * np.sqrt(count * (len(values) - count)))])


def _median(values: Floats) -> Floats:
    """Median over the views (frame, view) with a measurement; nan where none has one, float64 (frame,)."""
    median = np.full(len(values), np.nan if values.shape[1] else 0.0)
    some = np.isfinite(values).any(axis=1)
    median[some] = np.nanmedian(values[some], axis=1)
    return median


def _spread(values: Floats) -> float:
    """Robust standard deviation (scaled median absolute deviation)."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _frames_per_sample(residual: Floats) -> float:
    """Frames per independent frame under an AR(1) model of the scores."""
    correlation = float((residual[1:] * residual[:-1]).sum() / max(float((residual**2).sum()), 1e-12))
    correlation = min(max(correlation, 0.0), 0.95)
    return (1 + correlation) / (1 - correlation)


@dataclass(frozen=True)
class ViewResidual:
    """A view with a systematic residual across its line of sight."""

    view: int
    """Its number."""
    metres: float
    """Median residual, positive to the right of the image."""


def views_off(residuals: Floats, cell: float) -> list[ViewResidual]:
    """Views with the largest residuals where these exceed the side of a cell, metres; largest first.

    Residuals float64 (window, view) are in metres, nan where a view has no measurement.
    """
    median = np.array([_clear_median(view_residuals[np.isfinite(view_residuals)]) for view_residuals in residuals.T])
    order = np.argsort(-np.abs(median), kind="stable")
    farthest = float(np.abs(median).max(initial=0.0))
    named = [int(view) for view in order if abs(median[view]) >= _REPORTED_SHARE * farthest]
    return [ViewResidual(view, float(median[view])) for view in named] if farthest > cell else []


def _clear_median(residuals: Floats) -> float:
    """The median, 0 where there are few measurements or it is not significant."""
    if len(residuals) < _LEAST_WINDOWS:
        return 0.0
    median = float(np.median(residuals))
    error = _spread(residuals) / np.sqrt(len(residuals))
    return median if abs(median) > _RESIDUAL_ERRORS * error else 0.0


def find_residual_step(residuals: Floats, cell: float) -> Knock | None:
    """The largest step of a residual by half a cell or more: a knocked camera; None where there is none.

    The knock's `frame` is the index of a window; `before` and `after` are in metres.
    """
    steps = [(side, knock) for side in (1.0, -1.0) for knock in find_knocks(side * residuals, cell / 2)]
    if not steps:
        return None
    side, knock = max(steps, key=lambda step: abs(step[1].before - step[1].after))
    return Knock(knock.view, knock.frame, side * knock.before, side * knock.after, knock.errors)
