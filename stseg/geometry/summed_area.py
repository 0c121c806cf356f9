"""Summed-area tables (Crow 1984): means over the footprints of cells, four look-ups each.

Likelihoods are taken in whole levels of 1 / TOP_LEVEL, so that sums are exact, and modulo 2^32, which does no harm: the
sum over a footprint comes from four entries by differences, and is itself below 2^32.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Singles
from stseg.kernels.accelerate import kernel

TOP_LEVEL = 4095
"""The level of likelihood 1."""
LARGEST_SIDE = 1024
"""Pixels; sums over larger footprints would not fit."""
UNSEEN = -1
"""In place of a level: the view does not see the cell."""

SummedArea = NDArray[np.uint32]
Levels = NDArray[np.int16]
"""int16 (plane, y, x): mean likelihood of each cell's footprint in units of 1 / TOP_LEVEL, or UNSEEN."""


class SumTable(NamedTuple):
    """Sums over a part of a view, the column and row where that part begins, and the lowest level there."""

    sums: SummedArea
    left: int
    top: int
    lowest: int

    @classmethod
    def over(cls, region: tuple[slice, slice]) -> Self:
        """A table for rows and columns of a view, not filled yet."""
        rows, columns = region
        sums = np.empty((rows.stop - rows.start + 1, columns.stop - columns.start + 1), np.uint32)
        return cls(sums, columns.start, rows.start, TOP_LEVEL)

    def filled(self, likelihood: Singles) -> Self:
        """The table of a view's map (v, u); the array of sums is used anew."""
        return self._replace(lowest=fill_summed_area(likelihood, self.left, self.top, self.sums))


@kernel
def level_of(likelihood: np.float32) -> np.int32:
    """The nearest level; values outside 0..1 are clipped, NaN counts as 0."""
    above = likelihood if likelihood > 0 else np.float32(0.0)
    within = above if above < 1 else np.float32(1.0)
    return np.int32(within * np.float32(TOP_LEVEL) + np.float32(0.5))


@kernel
def fill_summed_area(likelihood: Singles, left: int, top: int, sums: SummedArea) -> int:
    """Fill sums (v + 1, u + 1), 0 in the first row and column: the levels of all pixels above and to the left.

    Parameters
    ----------
    likelihood : float32 (rows, columns)
        0..1.
    left, top
        Where the part of it begins that is summed.

    Returns
    -------
    int
        The lowest level of that part; TOP_LEVEL where there is none.
    """
    columns = sums.shape[1] - 1
    row, lowest = np.empty(columns, np.uint32), np.full(columns, TOP_LEVEL, np.uint32)
    sums[0] = 0
    for v in range(len(sums) - 1):
        here = likelihood[top + v, left : left + columns]  # of whole rows: a strided part would be no vector code
        for u in range(columns):
            row[u] = level_of(here[u])
        for u in range(columns):
            lowest[u] = min(lowest[u], row[u])
        total = np.uint32(0)
        for u in range(columns):
            total += row[u]
            row[u] = total
        sums[v + 1, 0] = 0
        for u in range(columns):
            sums[v + 1, u + 1] = sums[v, u + 1] + row[u]
    least = np.uint32(TOP_LEVEL)
    for u in range(columns):
        least = min(least, lowest[u])
    return int(least)


@kernel
def sum_of(sums: SummedArea, left: int, top: int, right: int, bottom: int) -> np.uint32:
    """Sum over the pixels of rows top..bottom - 1 and columns left..right - 1."""
    # Unsigned places: none is negative, which is not asked here.
    u, v, stop, end = np.uint64(left), np.uint64(top), np.uint64(right), np.uint64(bottom)
    return np.uint32((sums[end, stop] - sums[end, u]) - (sums[v, stop] - sums[v, u]))
