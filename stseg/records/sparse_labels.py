"""Track ids of the cells of a frame: a large ground is background nearly everywhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from stseg.arrays import Ints, Labels


@dataclass(frozen=True)
class SparseLabels:
    """Track ids of a frame's cells; all others are background."""

    shape: tuple[int, int, int]
    """Planes, rows and columns of the grid."""
    cell: Ints
    """int64 (n,): indices in the flattened volume, each once."""
    track: Labels
    """int32 (n,): track id of each, 0 for background."""

    @classmethod
    def whole(cls, label: Labels) -> Self:
        """Labels by the track ids of all cells, int32 (plane, y, x)."""
        cell = np.flatnonzero(label)
        planes, rows, columns = label.shape
        return cls((planes, rows, columns), cell, label.reshape(-1)[cell])

    def dense(self) -> Labels:
        """All cells, int32 (plane, y, x)."""
        label = np.zeros(self.shape, np.int32)
        label.reshape(-1)[self.cell] = self.track
        return label

    def without(self, tracks: Ints) -> SparseLabels:
        """The same, background in place of some tracks, int64 (k,)."""
        kept = ~np.isin(self.track, tracks)
        return SparseLabels(self.shape, self.cell[kept], self.track[kept])
