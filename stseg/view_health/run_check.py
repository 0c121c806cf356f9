"""Rig check of a finished run: reprojection residuals of each view over time.

The residuals are those of the detector (`reprojection_residuals`), window by window. A wrong view draws detections
towards itself: its residual understates its error. Views along the same line of sight get residuals too. With three
views, or two that face each other, positions cannot decide which is wrong; all views as far off are reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.view_health.knock_detection import Knock, find_knocks

_LEAST_WINDOWS = 5
"""Windows with a residual that a view needs."""
_RESIDUAL_ERRORS = 3.0
"""Least residual in standard errors."""
_REPORTED_SHARE = 0.6
"""Share of the largest residual from which a view is reported too."""


@dataclass(frozen=True)
class ViewResidual:
    """A view with a systematic residual across its line of sight.

    Attributes
    ----------
    view
        Its number.
    metres
        Median residual, positive to the right of the image.
    """

    view: int
    metres: float


def views_off(residuals: Floats, cell: float) -> list[ViewResidual]:
    """Views with the largest residuals where these exceed a cell; largest first.

    Parameters
    ----------
    residuals : float64 (window, view)
        Metres; nan where a view has no measurement.
    cell
        Side of a cell, metres.
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
    error = 1.4826 * float(np.median(np.abs(residuals - median))) / np.sqrt(len(residuals))
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
