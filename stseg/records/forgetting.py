"""Sums of weights and weighted measurements that are forgotten at exp(-t / memory): the state of learned noise."""

from types import EllipsisType

import numpy as np

from stseg.arrays import Flags, Floats

Selection = int | Flags | EllipsisType
"""Rows of the sums: one, those of a mask, or all."""


class Forgetting:
    """Decaying sums of a session: weights and weighted sums of what was counted, in the unit of `add`.

    `sums` float64 have the given shape. The time constant is `memory` seconds, and at least `least_frames` frames.
    """

    def __init__(self, shape: tuple[int, ...], frame_rate: float, memory: float, least_frames: float = 0.0) -> None:
        self.sums: Floats = np.zeros(shape)
        self._frame_rate, self._memory = frame_rate, max(frame_rate * memory, least_frames)
        self._frames, self._skipped = 1, 0

    def skip_frame(self) -> None:
        """Defer the weight of a frame that is not measured to the next one that is."""
        self._skipped += 1

    def forget(self, rows: Selection = ..., frames: int = 1) -> None:
        """Decay by the next frames, and by those skipped before them."""
        self._frames, self._skipped = frames + self._skipped, 0
        self.sums[rows] *= np.exp(-self._frames / self._memory)

    def add(self, counts: Floats, rows: Selection = ...) -> None:
        """Add counts to the sums."""
        self.sums[rows] += counts

    def seconds(self, counts: Floats) -> Floats:
        """Counts of one frame as seconds: for the time of the frames that were forgotten last."""
        return counts * self._frames / self._frame_rate

    def with_prior(self, weight: float, prior: Floats) -> Floats:
        """The sums, and those of a prior for one unit of weight times its weight."""
        return self.sums + weight * prior
