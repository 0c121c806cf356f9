"""Means over a lattice's pillars of what a view's unexplained pixels say, at the cost of what they show.

Most of a view is certain background that nobody explains: its pixels all have the raster's lowest log-odds. What such
pixels sum to inside an outline is their number times that, so the lattice's cells are asked in strips of neighbours
whether there is anything else inside the box around their outlines.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.accelerate import kernel
from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.model.packed_outlines import PackedOutlines

_STRIP = 8
"""Cells of the lattice in a strip."""

Strips = NDArray[np.int16]
"""int16 (strip, 4): left, top, right, bottom of the box around the outlines of a strip's cells, raster pixels."""


class OpenPixels(NamedTuple):
    """Unexplained pixels of a view.

    Attributes
    ----------
    left_of : float64 (v, u + 1)
        Sums of their log-odds along rows, from the left, nats.
    shown : int32 (v + 1, u + 1)
        Number of pixels above and to the left that are explained, or have not the lowest log-odds.
    lowest : float
        The lowest log-odds of the raster, nats.
    """

    left_of: Floats
    shown: Labels
    lowest: float

    @classmethod
    def of(cls, raster: Singles, unexplained: Flags) -> Self:
        """From the log-odds of all pixels, float32 (v, u), and those that nobody explains, bool (v, u)."""
        (rows, columns), lowest = raster.shape, raster.min(initial=np.inf)
        left_of, shown = np.empty((rows, columns + 1)), np.empty((rows + 1, columns + 1), np.int32)
        _fill_open(raster, unexplained, lowest, left_of, shown)
        return cls(left_of, shown, float(lowest))


def strip_boxes(outlines: PackedOutlines, cells: int) -> Strips:
    """The strips of a lattice of so many cells by the outlines (height * cell,) of their pillars."""
    boxes = np.zeros((-(-cells // _STRIP), 4), np.int16)
    boxes[:, :2] = np.iinfo(np.int16).max
    _fill_strips(outlines, cells, boxes)
    return boxes


def add_means(
    pixels: OpenPixels,
    strips: Strips,
    outlines: PackedOutlines,
    heights: Ints,
    cells: Ints,
    weight: float,
    score: Floats,
) -> None:
    """Add to score (height, cell) the weighted means over outlines (height * cell,) of some heights and cells."""
    empty = np.empty(len(strips), bool)
    _fill_empty(strips, pixels.shown, empty)
    _add_means(pixels, empty, outlines, heights, cells, weight, score)


@kernel
def _fill_open(raster: Singles, unexplained: Flags, lowest: np.float32, left_of: Floats, shown: Labels) -> None:
    """Fill left_of and shown; see `OpenPixels`."""
    rows, columns = raster.shape
    shown[0] = 0
    for v in range(rows):
        total, number = 0.0, 0
        left_of[v, 0], shown[v + 1, 0] = 0.0, 0
        for u in range(columns):
            total += float(raster[v, u]) if unexplained[v, u] else 0.0
            left_of[v, u + 1] = total
            number += 0 if unexplained[v, u] and raster[v, u] == lowest else 1
            shown[v + 1, u + 1] = shown[v, u + 1] + number


@kernel
def _fill_strips(outlines: PackedOutlines, cells: int, boxes: Strips) -> None:
    """Widen boxes (strip, 4), empty before, around the outlines."""
    for i in range(len(outlines.first)):
        box, row = boxes[i % cells // _STRIP], outlines.first[i]
        for k in range(outlines.start[i], outlines.start[i + 1]):
            left, right = outlines.spans[k]
            if right > left:
                box[0], box[1] = min(box[0], left), min(box[1], row)
                box[2], box[3] = max(box[2], right), max(box[3], row + 1)
            row += 1


@kernel
def _fill_empty(strips: Strips, shown: Labels, empty: Flags) -> None:
    """Fill empty (strip,): whether all pixels in the box of a strip are unexplained and lowest."""
    for k in range(len(strips)):
        left, top, right, bottom = strips[k]
        empty[k] = right == 0 or (shown[bottom, right] - shown[bottom, left] == shown[top, right] - shown[top, left])


@kernel
def _add_means(
    pixels: OpenPixels,
    empty: Flags,
    outlines: PackedOutlines,
    heights: Ints,
    cells: Ints,
    weight: float,
    score: Floats,
) -> None:
    """Add the weighted means of some heights and cells to score (height, cell); see `add_means`."""
    flat, columns = pixels.left_of.reshape(-1), pixels.left_of.shape[1]
    for height in heights:
        for cell in cells:
            i, total = height * score.shape[1] + cell, 0.0
            if outlines.inside[i] == 0:
                continue
            if empty[cell // _STRIP]:
                score[height, cell] += weight * (pixels.lowest * outlines.inside[i]) / outlines.area[i]
                continue
            outline = outlines.spans[outlines.start[i] : outlines.start[i + 1]]
            line = np.uint64(outlines.first[i] * columns)
            for k in range(len(outline)):  # unsigned places: none is negative, which is not asked here
                start, stop = np.uint64(np.uint16(outline[k, 0])), np.uint64(np.uint16(outline[k, 1]))
                total += flat[line + stop] - flat[line + start]
                line += np.uint64(columns)
            score[height, cell] += weight * total / outlines.area[i]
