"""What the pixels that nobody explains say of the birth lattice's pillars, at the cost of what they show.

Most of a view is certain background that nobody explains: its pixels all have the raster's lowest log-odds. So what a
pillar's outline sums to is at most its pixels times that, and what the pixels of the box around it have more. Pixels
are summed only where all views together may say enough; the sums along a row are taken as far as they are asked for.

What lowest pixels sum to is their number times that: the lattice's cells are asked in strips of neighbours whether
there is anything else inside the box around their outlines.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.accelerate import kernel, part
from stseg.arrays import Flags, Floats, Ints, Labels, Shorts, Singles
from stseg.config import BodyConfig
from stseg.detection.views import PixelView, View
from stseg.model.outlines import Spans
from stseg.model.packed_outlines import PackedOutlines
from stseg.pointed_tuples import pointed

_STRIP = 8
"""Cells of the lattice in a strip."""
_DRAWN = 4096
"""Pillars of the lattice that are drawn at once: until they are packed, each takes as many rows as the tallest."""
_ROUNDING = 1e-6
"""Above what rounding adds to a bound, nats."""

_SHADES = 64.0
"""Steps of log-odds that are counted, one over nats."""


class PixelLattice(NamedTuple):
    """Pillars of the birth lattice in all views of a rig that deliver pixels.

    Attributes
    ----------
    outlines
        Of the pillars (view * cell * height,), which are asked for cell by cell; areas are fair ones.
    boxes : int16 (view, cell, 4)
        left, top, right, bottom of the box around the outlines of all heights, raster pixels.
    strips : int16 (view, strip, 4)
        The same around the outlines of a strip's cells.
    shapes : int64 (view, 2)
        Rows and columns of the rasters.
    nobody : int16 (view, v * u)
        Owners of the pixels of rasters, -1, but while a search uses them.
    above, left_of
        Scratch of `OpenPixels`, whose memory would have to be asked for anew in each frame.
    """

    outlines: PackedOutlines
    boxes: Shorts
    strips: Shorts
    shapes: Ints
    nobody: Shorts
    above: Labels
    left_of: Floats

    @classmethod
    def of(cls, views: Sequence[View], lattice_ground: Floats, body: BodyConfig) -> Self:
        """The pillars of the configured heights at places (cell, 2), metres."""
        chosen = [view for view in views if isinstance(view, PixelView)]
        outlines = PackedOutlines.of(_drawn(chosen, lattice_ground, body))
        boxes = np.zeros((len(chosen), len(lattice_ground), 4), np.int16)
        strips = np.zeros((len(chosen), -(-len(lattice_ground) // _STRIP), 4), np.int16)
        boxes[..., :2] = strips[..., :2] = np.iinfo(np.int16).max
        _fill_boxes(outlines, len(body.heights), len(lattice_ground), boxes, strips)
        shapes = np.array([view.shape for view in chosen], np.int64).reshape(-1, 2)
        rows, columns = shapes.max(0, initial=0)
        above = np.empty((len(chosen), rows + 1, columns + 1), np.int32)
        nobody = np.full((len(chosen), rows * columns), -1, np.int16)
        return cls(outlines, boxes, strips, shapes, nobody, above, np.empty((len(chosen), rows, columns + 1)))


def _drawn(
    views: Sequence[PixelView], lattice_ground: Floats, body: BodyConfig
) -> Iterator[tuple[Ints, Spans, Floats]]:
    """Outlines of all pillars, one view after the other."""
    heights = np.tile(np.asarray(body.heights), len(lattice_ground))
    places, widths = np.repeat(lattice_ground, len(body.heights), 0), body.width_of(heights)
    for view in views:
        for begin in range(0, len(heights), _DRAWN):
            own = slice(begin, begin + _DRAWN)
            yield view.outlines(places[own], heights[own], widths[own])


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
def _fill_boxes(outlines: PackedOutlines, heights: int, cells: int, boxes: Shorts, strips: Shorts) -> None:
    """Widen boxes (view, cell, 4) and strips (view, strip, 4), empty before, around the outlines."""
    for i in range(len(outlines.first)):
        view, cell, row = i // (heights * cells), i // heights % cells, outlines.first[i]
        box, strip = boxes[view, cell], strips[view, cell // _STRIP]
        for k in range(outlines.start[i], outlines.start[i + 1]):
            left, right = outlines.spans[k]
            if right > left:
                box[0], box[1] = min(box[0], left), min(box[1], row)
                box[2], box[3] = max(box[2], right), max(box[3], row + 1)
            row += 1
        if box[2] > 0:
            strip[0], strip[1] = min(strip[0], box[0]), min(strip[1], box[1])
            strip[2], strip[3] = max(strip[2], box[2]), max(strip[3], box[3])


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
            pixels.is_shown[view, k] = strips[view, k, 2] > 0 and _inside(view, k, strips[view], pixels.above) > 0


@part
def _fill_more(raster: Singles, owner: Shorts, lowest: np.float32, more: Labels) -> None:
    """Fill more (u,) with what pixels of a row have more than the lowest, in steps."""
    for u in range(len(raster)):
        value = raster[u] if owner[u] < 0 else np.float32(0)
        steps = np.int32((value - lowest) * np.float32(_SHADES)) + np.int32(1)
        more[u] = np.int32(0) if owner[u] < 0 and value == lowest else max(steps, np.int32(1))


@part
def _inside(view: int, box: int, boxes: Shorts, above: Labels) -> int:
    """What the pixels of a view in one of the boxes have more than the lowest, in steps."""
    at = np.uint64(view)
    left, top, right, bottom = (
        _place(boxes[box, 0]),
        _place(boxes[box, 1]),
        _place(boxes[box, 2]),
        _place(boxes[box, 3]),
    )
    return int(above[at, bottom, right] - above[at, bottom, left] - above[at, top, right] + above[at, top, left])


@part
def _place(number: int) -> np.uint64:
    """A row or column that is not negative, which is not asked where it is used."""
    return np.uint64(np.uint16(number))


@kernel
def fill_scores(
    every_pixel: OpenPixels,
    every_pillar: PixelLattice,
    probes: Ints,
    others: Ints,
    hopeless: float,
    weight: float,
    score: Floats,
) -> None:
    """Add to score (height, cell), nats, what unexplained pixels say of pillars, or make it -inf where it matters not.

    That is at all heights of a cell that is worth no more than `hopeless` at the heights `probes`, and at others where
    a pillar is worth nothing.
    """
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    more, parts = np.empty((2, len(every_pillar.shapes)))
    for cell in range(score.shape[1]):
        best = -np.inf
        fill_around(cell, pixels, lattice, more)
        for height in probes:
            pillar = cell * len(score) + height
            score[height, cell] = add_said(
                score[height, cell], hopeless, pillar, cell, score.size, pixels, lattice, weight, more, parts
            )
            best = max(best, score[height, cell])
        for height in others:
            pillar, before = cell * len(score) + height, score[height, cell]
            score[height, cell] = (
                add_said(before, 0.0, pillar, cell, score.size, pixels, lattice, weight, more, parts)
                if best > hopeless
                else -np.inf
            )


@part
def fill_around(cell: int, pixels: OpenPixels, lattice: PixelLattice, more: Floats) -> None:
    """Fill more (view,) with a bound of what pixels around a cell's outlines have more than the lowest, nats."""
    for view in range(len(more)):
        is_seen = lattice.boxes[view, cell, 2] > 0
        more[view] = _inside(view, cell, lattice.boxes[view], pixels.above) * (1 / _SHADES) if is_seen else 0.0


@part
def add_said(
    before: float, least: float, pillar: int, cell: int, every: int, pixels: OpenPixels, lattice: PixelLattice,
    weight: float, more: Floats, parts: Floats,
) -> float:  # fmt: skip
    """A score with what all views say of a pillar, of so many in each view; -inf where that is not above the least.

    `more` is that of `fill_around`. Fills parts (view,) with what each says, nats.
    """
    most = before
    for view in range(len(parts)):
        parts[view] = _most(view, view * every + pillar, pixels, lattice, weight, more[view])
        most += parts[view]
    total = before
    for view in range(len(parts)):
        if most + _ROUNDING <= least:
            return -np.inf
        most -= parts[view]
        parts[view] = _said(view, view * every + pillar, cell, pixels, lattice, weight)
        most += parts[view]
        total += parts[view]
    return total


@part
def _most(view: int, i: int, pixels: OpenPixels, lattice: PixelLattice, weight: float, more: float) -> float:
    """The most that a view may say of the i-th pillar of all, nats."""
    inside, lowest = lattice.outlines.inside[i], pixels.extremes[view, 0]
    if inside == 0:
        return 0.0
    most = inside * lowest + min(more, inside * (max(pixels.extremes[view, 1], 0.0) - lowest))
    return float(weight * most / lattice.outlines.area[i])


@part
def _said(view: int, i: int, cell: int, pixels: OpenPixels, lattice: PixelLattice, weight: float) -> float:
    """What a view says of the i-th pillar of all, nats."""
    outlines, total = lattice.outlines, 0.0
    if outlines.inside[i] == 0:
        return 0.0
    if not pixels.is_shown[view, cell // _STRIP]:
        return float(weight * (pixels.extremes[view, 0] * outlines.inside[i]) / outlines.area[i])
    at, row = np.uint64(view), np.uint64(outlines.first[i])
    for k in range(np.uint64(outlines.start[i]), np.uint64(outlines.start[i + 1])):
        start, stop = _place(outlines.spans[k, 0]), _place(outlines.spans[k, 1])
        if stop > pixels.known[at, row]:
            _sum_to(stop, at, row, lattice.shapes[view, 1], pixels)
        total += pixels.left_of[at, row, stop] - pixels.left_of[at, row, start]
        row += np.uint64(1)
    return float(weight * total / outlines.area[i])


@part
def _sum_to(stop: np.uint64, view: np.uint64, row: np.uint64, columns: int, pixels: OpenPixels) -> None:
    """Sum a row's pixels as far as a column."""
    known = pixels.known[view, row]
    line, total = np.uint64(pixels.start[view]) + row * np.uint64(columns), pixels.left_of[view, row, known]
    for u in range(known, stop):
        total += float(pixels.raster[view, row, u]) if pixels.owner[line + u] < 0 else 0.0
        pixels.left_of[view, row, u + np.uint64(1)] = total
    pixels.known[view, row] = stop
