"""The unexplained pixels of a frame as sums: of all pixels in boxes, and along rows as far as these are asked for.

Most of a view is certain background that nobody explains: its pixels all have the raster's lowest log-odds. So what
pixels have *more* than the lowest is summed, and strips of the lattice's cells are asked whether there is anything else
inside the box around their outlines.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints, Labels, Shorts, Singles
from stseg.detection.evidence.pixel_lattice import PixelLattice
from stseg.kernels.accelerate import kernel, part

STEPS = 64.0
"""Steps of log-odds that are counted, one over nats."""


class OpenPixels(NamedTuple):
    """Unexplained pixels of all views that deliver pixels, until others are looked at.

    Attributes
    ----------
    raster : float32 (view, v, u)
        Log-odds, nats.
    owner : int16 (pixel,)
        Who explains each pixel of one view after the other, -1 for nobody.
    start : int64 (view,)
        Where each view begins in it.
    left_of : float64 (view, v, u + 1)
        Sums of the log-odds that nobody explains along rows, from the left, nats; not all of them are known.
    known : uint64 (view, v)
        The last column of each row whose sum is known.
    above : int32 (view, v + 1, u + 1)
        Sums of what pixels above and to the left have more than the lowest, nats, in steps and rounded up. It is at
        least one step of each that is explained, or is not the lowest.
    is_shown : bool (view, strip)
        Whether anything but lowest pixels that nobody explains is in the box of a strip.
    extremes : float64 (view, 2)
        The lowest and the highest log-odds, nats.
    """

    raster: Singles
    owner: Shorts
    start: Ints
    left_of: Floats
    known: NDArray[np.uint64]
    above: Labels
    is_shown: Flags
    extremes: Floats

    @classmethod
    def of(cls, rasters: Singles, owners: Shorts, lattice: PixelLattice, extremes: Floats) -> Self:
        """From the log-odds of all pixels, float32 (view, v, u), and who explains them, int16 (pixel,)."""
        number, is_shown = lattice.shapes.prod(1), np.empty(lattice.strips.shape[:2], bool)
        known = np.zeros(rasters.shape[:2], np.uint64)
        pixels = cls(
            rasters, owners, number.cumsum() - number, lattice.left_of, known, lattice.above, is_shown, extremes
        )
        _fill_above(pixels, lattice.shapes, lattice.strips)
        return pixels


@kernel
def _fill_above(pixels: OpenPixels, shapes: Ints, strips: Shorts) -> None:
    """Fill above and is_shown, and the sums of no pixels; see `OpenPixels`."""
    more = np.empty(pixels.raster.shape[2], np.int32)
    for view in range(len(shapes)):
        lowest, above = np.float32(pixels.extremes[view, 0]), pixels.above[view]
        rows, columns = shapes[view]
        above[0] = 0
        for v in range(rows):
            start = pixels.start[view] + v * columns
            _fill_more(pixels.raster[view, v, :columns], pixels.owner[start : start + columns], lowest, more)
            number, above[v + 1, 0], pixels.left_of[view, v, 0] = np.int32(0), 0, 0.0
            for u in range(columns):
                number += more[u]
                above[v + 1, u + 1] = above[v, u + 1] + number
        for k in range(strips.shape[1]):
            pixels.is_shown[view, k] = strips[view, k, 2] > 0 and more_inside(view, k, strips[view], pixels.above) > 0


@part
def _fill_more(raster: Singles, owner: Shorts, lowest: np.float32, more: Labels) -> None:
    """Fill more (u,) with what pixels of a row have more than the lowest, in steps."""
    for u in range(len(raster)):
        value = raster[u] if owner[u] < 0 else np.float32(0)
        steps = np.int32((value - lowest) * np.float32(STEPS)) + np.int32(1)
        more[u] = np.int32(0) if owner[u] < 0 and value == lowest else max(steps, np.int32(1))


@part
def more_inside(view: int, box: int, boxes: Shorts, above: Labels) -> np.int32:
    """What the pixels of a view in one of the boxes have more than the lowest, in steps; sums above are modulo 2^32."""
    at = np.uint64(view)
    left, top = place(boxes[box, 0]), place(boxes[box, 1])
    right, bottom = place(boxes[box, 2]), place(boxes[box, 3])
    return np.int32(above[at, bottom, right] - above[at, bottom, left] - above[at, top, right] + above[at, top, left])


@part
def place(number: int) -> np.uint64:
    """A row or column that is not negative, which is not asked where it is used."""
    return np.uint64(np.uint16(number))


@part
def sum_to(stop: np.uint64, view: np.uint64, row: np.uint64, columns: int, pixels: OpenPixels) -> None:
    """Sum a row's pixels as far as a column."""
    known = pixels.known[view, row]
    line, total = np.uint64(pixels.start[view]) + row * np.uint64(columns), pixels.left_of[view, row, known]
    for u in range(known, stop):
        total += float(pixels.raster[view, row, u]) if pixels.owner[line + u] < 0 else 0.0
        pixels.left_of[view, row, u + np.uint64(1)] = total
    pixels.known[view, row] = stop
