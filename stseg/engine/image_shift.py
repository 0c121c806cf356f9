"""How far the pictures of colour cameras have moved since their backgrounds were learned: a knock of a pixel shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.calibration.knock_detection import background_shift
from stseg.engine.session import FrameSet
from stseg.foreground.view_foreground import ViewForeground
from stseg.model.tables import SHIFT

_EVERY = 2.0
"""Seconds from one look to the next."""


class ImageShifts:
    """Looks at moments while they are handed on.

    Parameters
    ----------
    sights
        Each camera's way from observation to evidence; only those with a background are looked at.
    factors
        How far each camera's frames are reduced.
    frame_rate
        Frames per second.
    """

    def __init__(self, sights: Sequence[ViewForeground], factors: Sequence[int], frame_rate: float) -> None:
        self._sights, self._factors = sights, factors
        self._every = max(1, round(_EVERY * frame_rate))
        self._rows: list[tuple[int, int, float, float]] = []

    def watch(self, moments: Iterator[FrameSet]) -> Iterator[FrameSet]:
        """The moments, each looked at as it is handed on."""
        for moment in moments:
            self.look(moment)
            yield moment

    def look(self, moment: FrameSet) -> None:
        """Look at a moment, if it is time."""
        if moment.frame % self._every == 0:
            self._look(moment)

    def rows(self, first: int, stop: int) -> Rows:
        """SHIFT rows of frames first .. stop - 1."""
        return np.array([row for row in self._rows if first <= row[0] < stop], SHIFT)

    def _look(self, moment: FrameSet) -> None:
        for view, (sight, image, factor) in enumerate(zip(self._sights, moment.views, self._factors, strict=True)):
            if sight.background is not None and isinstance(image, np.ndarray):
                background = np.clip(sight.background.model.background_image(), 0, 255).astype(np.uint8)
                u, v = factor * background_shift(background, np.asarray(image, np.uint8))
                self._rows.append((moment.frame, view, float(u), float(v)))
