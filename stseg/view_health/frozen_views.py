"""Views that are frozen: a stream that hangs repeats its last picture, mask or boxes while the other cameras go on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Observation

_FROZEN_TIME, _FROZEN_FRAMES = 0.5, 3
"""Least time for which a frozen view repeats itself, seconds, and frames: longer than that of a frame in a gap."""

_COMPARED_STRIDE = 32
"""Rows from one to the next of those that are compared first: they differ in nearly every picture that does."""


class FrozenViews:
    """Recognition of frozen views in frame sets, in the order of time.

    A view is frozen once it has been the same, bit by bit, for half a second in which most of the others changed.
    Where all stand still, or a view shows no person, sameness is no failure.

    Parameters
    ----------
    views
        Number of views.
    frame_rate
        Frames per second.
    """

    def __init__(self, views: int, frame_rate: float) -> None:
        self._least = max(_FROZEN_FRAMES, round(_FROZEN_TIME * frame_rate))
        self._last: list[Observation] = [None] * views
        self._repeated = np.zeros(views, int)

    def without(self, observations: Sequence[Observation]) -> list[Observation]:
        """The observations of the next frame set; None for a frozen view."""
        same = np.array([_is_repeated(*pair) for pair in zip(observations, self._last, strict=True)])
        delivered = np.array([view is not None for view in observations])
        changed = delivered & ~same
        others = delivered.sum() - 1
        self._repeated[changed] = 0
        self._repeated[same & (2 * changed.sum() > others)] += 1
        self._last = list(observations)
        frozen = self._repeated >= self._least
        return [None if is_frozen else view for is_frozen, view in zip(frozen, observations, strict=True)]


def _is_repeated(view: Observation, last: Observation) -> bool:
    """Whether an observation is not empty and equals the last one."""
    if isinstance(view, Boxes):
        return isinstance(last, Boxes) and len(view) > 0 and np.array_equal(view.pixel, last.pixel)
    if view is None or last is None or isinstance(last, Boxes):
        return False
    if not (np.array_equal(view[::_COMPARED_STRIDE], last[::_COMPARED_STRIDE]) and np.array_equal(view, last)):
        return False
    return view.ndim == 3 or bool(np.any(view))
