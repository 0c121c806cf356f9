"""Log-odds of a frame: cell by cell where a view shows something, elsewhere one value for each set of views."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from stseg.arrays import Ints, Labels, Singles
from stseg.kernels.accelerate import kernel


@dataclass(frozen=True)
class SparseVolume:
    """Log-odds of a frame: those of the cells at which something is shown, and one value for each set of views."""

    of_cell: Labels
    """int32 (plane, y, x): the set of views of each cell."""
    empty: Singles
    """float32 (set,): log-odds of the other cells of each set, nats; nan where no view sees them."""
    cell: Labels
    """int32 (n,): indices in the flattened volume."""
    value: Singles
    """float32 (n,): log-odds at these cells, nats."""

    @classmethod
    def whole(cls, volume: Singles) -> Self:
        """Volume of the log-odds of all cells, float32 (plane, y, x)."""
        cells = np.arange(volume.size, dtype=np.int32)
        return cls(np.zeros(volume.shape, np.int32), np.full(1, np.nan, np.float32), cells, volume.reshape(-1))

    @property
    def place(self) -> Labels:
        """Ground cell of each, in the flattened ground, int32 (n,)."""
        return self.cell % np.int32(self.of_cell[0].size)

    def dense(self) -> Singles:
        """All cells, float32 (plane, y, x)."""
        volume = np.empty(self.of_cell.shape, np.float32)
        _fill_volume(self.of_cell.reshape(-1), self.empty, self.cell, self.value, volume.reshape(-1))
        return volume

    def occupied_places(self) -> Ints:
        """Ground cells (k,), in the flattened ground, above which log-odds are above 0."""
        places = self.cell[self.value > 0] % np.int32(self.of_cell[0].size)
        sets = np.flatnonzero(self.empty > 0)
        if len(sets):
            places = np.append(places, np.flatnonzero(np.isin(self.of_cell, sets).any(0)))
        return np.unique(places.astype(np.int64))

    def at(self, places: Ints) -> Singles:
        """Log-odds above ground cells (k,) of the flattened ground, each once: float32 (plane, k)."""
        planes = len(self.of_cell)
        index = np.full(self.of_cell[0].size, -1, np.int32)
        index[places] = np.arange(len(places))
        values = self.empty[self.of_cell.reshape(planes, -1)[:, places]]
        _take_over(index, self.cell, self.value, values)
        return values

    def with_values(self, places: Ints, values: Singles) -> SparseVolume:
        """The same with other log-odds (plane, k) above ground cells (k,)."""
        ground = self.of_cell[0].size
        changed = np.zeros(ground, bool)
        changed[places] = True
        kept = ~changed[self.place]
        cell = (np.arange(len(values))[:, None] * ground + places).astype(np.int32)
        return SparseVolume(
            self.of_cell, self.empty, np.append(self.cell[kept], cell), np.append(self.value[kept], values)
        )


@kernel
def _fill_volume(of_cell: Labels, empty: Singles, cell: Labels, value: Singles, volume: Singles) -> None:
    """Fill volume (cell,); see `SparseVolume`."""
    for c in range(len(volume)):
        volume[c] = empty[of_cell[c]]
    for k in range(len(cell)):
        volume[cell[k]] = value[k]


@kernel
def _take_over(index: Labels, cell: Labels, value: Singles, values: Singles) -> None:
    """Write the values (n,) of cells into values (plane, k); index (ground cell,) is -1 for those not among them."""
    for c in range(len(cell)):
        k = index[cell[c] % len(index)]
        if k >= 0:
            values[cell[c] // len(index), k] = value[c]
