"""The unexplained pixels of a frame as sums: of all pixels in boxes, and along rows as far as these are needed.

Most of a view is certain background: its pixels all have the raster's lowest log-odds. So the excess of pixels over
the lowest is summed, and a strip of the lattice's cells is skipped where the box around its outlines has no excess.
What pixels may add to a score is at most the sum of those that are rather foreground: once people are explained, few
are left, and most cells have none around them.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints, Labels, Shorts, Singles
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.kernels.accelerate import kernel, part

QUANTA_PER_NAT = 64.0
"""Quanta of log-odds in which the excess is summed, one over nats."""


class UnexplainedPixels(NamedTuple):
    """Unexplained pixels of all views that deliver pixels, valid until the next ones are made."""

    raster: Singles
    """float32 (view, v, u): log-odds, nats."""
    owner: Shorts
    """int16 (pixel,): the member who explains each pixel of one view after the other, -1 for none."""
    start: Ints
    """int64 (view,): first pixel of each view in `owner`."""
    left_of: Floats
    """float64 (view, v, u + 1): sums of the unexplained log-odds along rows, from the left, nats, as far as
    `summed_to`."""
    summed_to: NDArray[np.uint64]
    """uint64 (view, v): the last column of each row that is summed."""
    above: Labels
    """int32 (view, v + 1, u + 1): sums of the excess of pixels above and to the left over the lowest, in quanta and
    rounded up. It is at least one quantum of each that is explained, or is not the lowest."""
    gain_above: Labels
    """int32 (view, v + 1, u + 1): sums like `above` of the log-odds above 0 of pixels that no member explains."""
    is_shown: Flags
    """bool (view, strip): whether the box of a strip has any excess."""
    extremes: Floats
    """float64 (view, 2): the lowest and the highest log-odds, nats."""

    @classmethod
    def of(cls, rasters: Singles, owners: Shorts, lattice: PixelLattice, extremes: Floats) -> Self:
        """From the log-odds of all pixels, float32 (view, v, u), and the members who explain them, int16 (pixel,)."""
        number, is_shown = lattice.shapes.prod(1), np.empty(lattice.strips.box.shape[:2], bool)
        start, summed_to = number.cumsum() - number, np.zeros(rasters.shape[:2], np.uint64)
        left_of, above, gain_above = lattice.sums
        pixels = cls(rasters, owners, start, left_of, summed_to, above, gain_above, is_shown, extremes)
        _fill_above(pixels, lattice.shapes, lattice.strips.box)
        return pixels


@kernel
def _fill_above(pixels: UnexplainedPixels, shapes: Ints, strips: Shorts) -> None:
    """Fill the sums above and what strips show, and the sums of no pixels; see `UnexplainedPixels`."""
    more, gain = np.empty((2, pixels.raster.shape[2]), np.int32)
    for view in range(len(shapes)):
        lowest, above, gain_above = np.float32(pixels.extremes[view, 0]), pixels.above[view], pixels.gain_above[view]
        rows, columns = shapes[view]
        above[0], gain_above[0] = 0, 0
        for v in range(rows):
            start = pixels.start[view] + v * columns
            _fill_more(pixels.raster[view, v, :columns], pixels.owner[start : start + columns], lowest, more, gain)
            above[v + 1, 0], gain_above[v + 1, 0], pixels.left_of[view, v, 0] = 0, 0, 0.0
            number, gained = np.int32(0), np.int32(0)
            for u in range(columns):
                number += more[u]
                gained += gain[u]
                above[v + 1, u + 1] = above[v, u + 1] + number
                gain_above[v + 1, u + 1] = gain_above[v, u + 1] + gained
        for k in range(strips.shape[1]):
            is_seen = strips[view, k, 2] > 0
            pixels.is_shown[view, k] = is_seen and more_inside(view, k, strips[view], pixels.above) > 0


@part
def _fill_more(raster: Singles, owner: Shorts, lowest: np.float32, more: Labels, gain: Labels) -> None:
    """Fill more and gain (u,) with a row's excess over the lowest and with its log-odds above 0, in quanta."""
    for u in range(len(raster)):
        value = raster[u] if owner[u] < 0 else np.float32(0)
        steps = np.int32((value - lowest) * np.float32(QUANTA_PER_NAT)) + np.int32(1)
        more[u] = np.int32(0) if owner[u] < 0 and value == lowest else max(steps, np.int32(1))
        gain[u] = np.int32(value * np.float32(QUANTA_PER_NAT)) + np.int32(1) if value > 0 else np.int32(0)


@part
def more_inside(view: int, box: int, boxes: Shorts, above: Labels) -> np.int32:
    """Sum of a view's pixels in one of the boxes, in quanta; sums above are modulo 2^32."""
    at = np.uint64(view)
    left, top = unsigned(boxes[box, 0]), unsigned(boxes[box, 1])
    right, bottom = unsigned(boxes[box, 2]), unsigned(boxes[box, 3])
    return np.int32(above[at, bottom, right] - above[at, bottom, left] - above[at, top, right] + above[at, top, left])


@part
def unsigned(number: int) -> np.uint64:
    """A row or column that is not negative, so that no sign is checked where it is used."""
    return np.uint64(np.uint16(number))


@part
def sum_to(stop: np.uint64, view: np.uint64, row: np.uint64, columns: int, pixels: UnexplainedPixels) -> None:
    """Sum a row's pixels as far as a column."""
    summed_to = pixels.summed_to[view, row]
    line, total = np.uint64(pixels.start[view]) + row * np.uint64(columns), pixels.left_of[view, row, summed_to]
    for u in range(summed_to, stop):
        total += float(pixels.raster[view, row, u]) if pixels.owner[line + u] < 0 else 0.0
        pixels.left_of[view, row, u + np.uint64(1)] = total
    pixels.summed_to[view, row] = stop
