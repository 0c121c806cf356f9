"""A run's own look at its rig: which views see people beside where all views put them, and from when on.

What `ghosts.aside` measures of each frame, window by window. A view that is wrong draws the places of people towards
itself, so that what is told is less than its error, and views along the same line of sight are aside too: with three
views, or with two that face each other, places alone cannot tell which is wrong, and all that are as far off are named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.knock_detection import Knock, find_knocks

_LEAST = 5
"""Windows in which a view must have told of somebody."""
_CLEAR = 3.0
"""Standard errors that a view must be aside."""
_ALIKE = 0.6
"""Share of the most that any view is aside, from which on a view is named too."""


@dataclass(frozen=True)
class Aside:
    """A view that sees people beside their places.

    Attributes
    ----------
    view
        Its number.
    metres
        To its right, in the median.
    """

    view: int
    metres: float


def views_aside(aside: Floats, cell: float) -> list[Aside]:
    """The views that are aside most, if that is by more than a cell; the farthest first.

    Parameters
    ----------
    aside : float64 (window, view)
        Metres; nan where a view tells nothing.
    cell
        Side of a cell, metres.
    """
    median = np.array([_clear_median(own[np.isfinite(own)]) for own in aside.T])
    order = np.argsort(-np.abs(median), kind="stable")
    farthest = float(np.abs(median).max(initial=0.0))
    named = [int(view) for view in order if abs(median[view]) >= _ALIKE * farthest]
    return [Aside(view, float(median[view])) for view in named] if farthest > cell else []


def _clear_median(told: Floats) -> float:
    """The median, 0 where too little is told or that is not clear."""
    if len(told) < _LEAST:
        return 0.0
    median = float(np.median(told))
    error = 1.4826 * float(np.median(np.abs(told - median))) / np.sqrt(len(told))
    return median if abs(median) > _CLEAR * error else 0.0


def knocked(aside: Floats, cell: float) -> Knock | None:
    """The view that is aside by another half a cell or more from one window on: the one where that is clearest.

    The knock's frame is the index of a window; what is before and after it is in metres.
    """
    steps = [(side, knock) for side in (1.0, -1.0) for knock in find_knocks(side * aside, cell / 2)]
    if not steps:
        return None
    side, knock = max(steps, key=lambda step: abs(step[1].before - step[1].after))
    return Knock(knock.view, knock.frame, side * knock.before, side * knock.after, knock.errors)
