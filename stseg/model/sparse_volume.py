"""Log-odds of a frame: cell by cell where a view shows something, elsewhere one value for each set of views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Labels, Singles


@dataclass(frozen=True)
class SparseVolume:
    """Log-odds of a frame: those of the cells at which something is shown, and one value for each set of views.

    Attributes
    ----------
    of_cell : int32 (plane, y, x)
        The set of views of each cell.
    empty : float32 (set,)
        Log-odds of the other cells of each set, nats; nan where no view sees them.
    cell : int32 (n,), value : float32 (n,)
        Indices in the flattened volume, and log-odds there, nats.
    """

    of_cell: Labels
    empty: Singles
    cell: Labels
    value: Singles

    def dense(self) -> Singles:
        """All cells, float32 (plane, y, x)."""
        volume = np.empty(self.of_cell.shape, np.float32)
        _fill_volume(self.of_cell.reshape(-1), self.empty, self.cell, self.value, volume.reshape(-1))
        return volume


@kernel
def _fill_volume(of_cell: Labels, empty: Singles, cell: Labels, value: Singles, volume: Singles) -> None:
    """Fill volume (cell,); see `SparseVolume`."""
    for c in range(len(volume)):
        volume[c] = empty[of_cell[c]]
    for k in range(len(cell)):
        volume[cell[k]] = value[k]
