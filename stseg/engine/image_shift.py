"""Image registration of colour cameras to their backgrounds: a shift of one pixel reveals a knocked camera."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.engine.session import FrameSet
from stseg.foreground.view_foreground import ViewForeground
from stseg.records.tables import SHIFT
from stseg.view_health.knock_detection import background_shift

_PERIOD = 2.0
"""Time between measurements, seconds."""


class ImageShifts:
    """Shifts of the cameras' images relative to their background images, measured at fixed intervals.

    Parameters
    ----------
    foregrounds
        Foreground model of each camera; cameras without a background are not measured.
    factors
        Reduction factor of each camera's images.
    frame_rate
        Frames per second.
    """

    def __init__(self, foregrounds: Sequence[ViewForeground], factors: Sequence[int], frame_rate: float) -> None:
        self._foregrounds, self._factors = foregrounds, factors
        self._period = max(1, round(_PERIOD * frame_rate))
        self._rows: list[tuple[int, int, float, float]] = []

    def measured(self, frame_sets: Iterator[FrameSet]) -> Iterator[FrameSet]:
        """Pass frame sets through, and measure the shifts on the way."""
        for frame_set in frame_sets:
            self.measure(frame_set)
            yield frame_set

    def measure(self, frame_set: FrameSet) -> None:
        """Measure the shifts of a frame set, if a measurement is due."""
        if frame_set.frame % self._period == 0:
            self._measure(frame_set)

    def rows(self, first: int, stop: int) -> Rows:
        """SHIFT rows of frames first .. stop - 1, pixels of the full-size image."""
        return np.array([row for row in self._rows if first <= row[0] < stop], SHIFT)

    def _measure(self, frame_set: FrameSet) -> None:
        for view, (foreground, image, factor) in enumerate(
            zip(self._foregrounds, frame_set.views, self._factors, strict=True)
        ):
            if foreground.background is not None and isinstance(image, np.ndarray):
                background = np.clip(foreground.background.model.background_image(), 0, 255).astype(np.uint8)
                u, v = factor * background_shift(background, np.asarray(image, np.uint8))
                self._rows.append((frame_set.frame, view, float(u), float(v)))
