"""Mean likelihood of every cell in a view's map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Singles
from stseg.geometry.sampling import Sampling
from stseg.geometry.summed_area import Levels, Sums, fill_means, fill_points, fill_sums


class SumTable(NamedTuple):
    """Summed-area table of a part of a view, the column and row where that part begins, and its lowest level."""

    sums: Sums
    left: int
    top: int
    lowest: int


class CellMeans:
    """Means over the footprints of a rig's cells. Its buffers, one a view, are used anew: one object a thread.

    Parameters
    ----------
    sampling
        The rig's footprints.
    """

    def __init__(self, sampling: Sampling) -> None:
        self.footprint = sampling.footprint
        self.regions = sampling.regions()
        self.points = [int(boxes[..., 2:].max(initial=0)) <= 1 for boxes in self.footprint]
        shapes = [(rows.stop - rows.start + 1, columns.stop - columns.start + 1) for rows, columns in self.regions]
        self._sums = [np.empty(shape, np.uint32) for shape in shapes]

    def sum_table(self, view: int, likelihood: Singles) -> SumTable:
        """Sums over the part of a view's map (v, u) that cells cover."""
        rows, columns = self.regions[view]
        lowest = fill_sums(likelihood, columns.start, rows.start, self._sums[view])
        return SumTable(self._sums[view], columns.start, rows.start, lowest)

    def levels(self, view: int, likelihood: Singles) -> Levels:
        """Mean levels of all cells in a view's map (v, u); see `stseg.geometry.summed_area`."""
        if self.points[view]:
            levels = np.empty(self.footprint.shape[1:4], np.int16)
            fill_points(likelihood, self.footprint[view], levels)
            return levels
        return self.levels_from(view, self.sum_table(view, likelihood))

    def levels_from(self, view: int, table: SumTable) -> Levels:
        """The same from the map's sums."""
        levels = np.empty(self.footprint.shape[1:4], np.int16)
        fill_means(table.sums, self.footprint[view], table.left, table.top, levels)
        return levels
