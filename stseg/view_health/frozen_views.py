"""Views that are frozen: a stream that hangs repeats its last picture, mask or boxes while the other cameras go on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Observation

_SECONDS, _FRAMES = 0.5, 3
"""How long a view repeats itself until it is frozen: longer than a frame that fills a gap stands for."""

_FEW = 32
"""Rows from one to the next of those that are compared first: they differ in nearly every picture that does."""


class FrozenViews:
    """Recognition of frozen views in frame sets, in the order of time.

    A view is frozen once it has been the same, bit by bit, for half a second in which most of the others changed.
    Where all stand still, or a view shows nobody, sameness is no failure.

    Parameters
    ----------
    views
        Number of views.
    frame_rate
        Frames per second.
    """

    def __init__(self, views: int, frame_rate: float) -> None:
        self._least = max(_FRAMES, round(_SECONDS * frame_rate))
        self._last: list[Observation] = [None] * views
        self._repeated = np.zeros(views, int)

    def without(self, seen: Sequence[Observation]) -> list[Observation]:
        """The observations of the next frame set; None for a frozen view."""
        same = np.array([_same(*pair) for pair in zip(seen, self._last, strict=True)])
        there = np.array([view is not None for view in seen])
        changed = there & ~same
        others = there.sum() - 1
        self._repeated[changed] = 0
        self._repeated[same & (2 * changed.sum() > others)] += 1
        self._last = list(seen)
        return [None if repeated >= self._least else view for repeated, view in zip(self._repeated, seen, strict=True)]


def _same(seen: Observation, last: Observation) -> bool:
    """Whether a view shows something, and what it showed before."""
    if isinstance(seen, Boxes):
        return isinstance(last, Boxes) and len(seen) > 0 and np.array_equal(seen.pixel, last.pixel)
    if seen is None or last is None or isinstance(last, Boxes):
        return False
    if not (np.array_equal(seen[::_FEW], last[::_FEW]) and np.array_equal(seen, last)):
        return False
    return seen.ndim == 3 or bool(np.any(seen))
