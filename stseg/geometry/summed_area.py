"""Summed-area tables (Crow 1984): means over the footprints of cells, four look-ups each.

Likelihoods are taken in whole levels of 1 / TOP, so that sums are exact, and modulo 2^32, which does no harm: the sum
over a footprint comes from four entries by differences, and is itself below 2^32.
"""

from __future__ import annotations

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

Sums = NDArray[np.uint32]
Levels = NDArray[np.int16]
"""int16 (plane, y, x): mean likelihood of each cell's footprint in units of 1 / TOP, or UNSEEN."""


@kernel
def level_of(likelihood: np.float32) -> np.int32:
    """The nearest level; values outside 0..1 are clipped, NaN counts as 0."""
    above = likelihood if likelihood > 0 else np.float32(0.0)
    within = above if above < 1 else np.float32(1.0)
    return np.int32(within * np.float32(TOP_LEVEL) + np.float32(0.5))


@kernel
def fill_sums(likelihood: Singles, left: int, top: int, sums: Sums) -> int:
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
        The lowest level of that part; TOP where there is none.
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
def sum_of(sums: Sums, left: int, top: int, right: int, bottom: int) -> np.uint32:
    """Sum over the pixels of rows top..bottom - 1 and columns left..right - 1."""
    # Unsigned places: none is negative, which is not asked here.
    u, v, stop, end = np.uint64(left), np.uint64(top), np.uint64(right), np.uint64(bottom)
    return np.uint32((sums[end, stop] - sums[end, u]) - (sums[v, stop] - sums[v, u]))


@kernel
def fill_means(sums: Sums, footprint: NDArray[np.int16], left: int, top: int, levels: Levels) -> None:
    """Fill levels (plane, y, x) with means over footprints.

    Parameters
    ----------
    sums : uint32 (v + 1, u + 1)
        Of the part of the view that begins at column `left` and row `top`.
    footprint : int16 (plane, y, x, 4)
        See `stseg.geometry.sampling`.
    """
    boxes, flat = footprint.reshape(-1, 4), levels.reshape(-1)
    for c in range(len(boxes)):
        width, height = np.int32(boxes[c, 2]), np.int32(boxes[c, 3])
        if width == 0:
            flat[c] = UNSEEN
            continue
        u, v = boxes[c, 0] - left, boxes[c, 1] - top
        total = np.float32(sum_of(sums, u, v, u + width, v + height))
        flat[c] = np.int32(total / np.float32(width * height) + np.float32(0.5))


@kernel
def fill_points(likelihood: Singles, footprint: NDArray[np.int16], levels: Levels) -> None:
    """The same where every footprint is one pixel: of the whole view, without its sums."""
    boxes, flat = footprint.reshape(-1, 4), levels.reshape(-1)
    for c in range(len(boxes)):
        if boxes[c, 2] == 0:
            flat[c] = UNSEEN
            continue
        flat[c] = level_of(likelihood[boxes[c, 1], boxes[c, 0]])
