"""The pillars of the birth lattice in the views that deliver pixels: their outlines, and the boxes around these."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Floats, Ints, Labels, Shorts
from stseg.bodies.outlines import Spans
from stseg.bodies.packed_outlines import PackedOutlines
from stseg.bodies.views import PixelView, View
from stseg.config import BodyConfig
from stseg.kernels.accelerate import kernel

STRIP_CELLS = 8
"""Cells of the lattice in a strip."""
_PILLARS_AT_ONCE = 4096
"""Pillars of the lattice that are drawn at once: until they are packed, each takes as many rows as the tallest."""


class PillarBoxes(NamedTuple):
    """Bounds of the outlines of all heights in the cells of the lattice, or in its strips (n,)."""

    box: Shorts
    """int16 (view, n, 4): left, top, right, bottom of the box around them, raster pixels; right 0 for none."""
    inside_share: Floats
    """float64 (view, n): the least share of an outline that lies on the raster."""
    pixel_share: Floats
    """float64 (view, n): the greatest share of one pixel in an outline; 0 where the view sees none."""


class PixelLattice(NamedTuple):
    """Pillars of the birth lattice in all views of a rig that deliver pixels."""

    outlines: PackedOutlines
    """The pillars (view * height * cell,): most are asked for at one height; areas are fair ones."""
    cells: PillarBoxes
    """Bounds of each cell."""
    strips: PillarBoxes
    """The same of each `STRIP_CELLS` cells that follow each other."""
    shapes: Ints
    """int64 (view, 2): rows and columns of the rasters."""
    owner: Shorts
    """int16 (view, v * u): owners of the pixels of rasters, -1, but while a search uses them."""
    sums: tuple[Floats, Labels, Labels]
    """Memory for `left_of`, `above` and `gain_above` of `stseg.detection.evidence.unexplained_pixels`."""

    @classmethod
    def of(cls, views: Sequence[View], lattice_ground: Floats, body: BodyConfig) -> Self:
        """The pillars of the configured heights at places (cell, 2), metres."""
        chosen = [view for view in views if isinstance(view, PixelView)]
        outlines = PackedOutlines.of(_drawn(chosen, lattice_ground, body))
        boxes = np.zeros((len(chosen), len(lattice_ground), 4), np.int16)
        strips = np.zeros((len(chosen), -(-len(lattice_ground) // STRIP_CELLS), 4), np.int16)
        boxes[..., :2] = strips[..., :2] = np.iinfo(np.int16).max
        _fill_boxes(outlines, len(body.heights), len(lattice_ground), boxes, strips)
        shapes = np.array([view.shape for view in chosen], np.int64).reshape(-1, 2)
        rows, columns = shapes.max(0, initial=0)
        above, gain_above = np.empty((2, len(chosen), rows + 1, columns + 1), np.int32)
        owner = np.full((len(chosen), rows * columns), -1, np.int16)
        sums = np.empty((len(chosen), rows, columns + 1)), above, gain_above
        per_cell = (len(chosen), len(body.heights), len(lattice_ground))
        share = np.where(outlines.inside > 0, 1 / np.maximum(outlines.area, 1), 0.0)
        inside_share, pixel_share = (outlines.inside * share).reshape(per_cell).min(1), share.reshape(per_cell).max(1)
        first = np.arange(0, len(lattice_ground), STRIP_CELLS)
        in_strips = np.minimum.reduceat(inside_share, first, 1), np.maximum.reduceat(pixel_share, first, 1)
        cells = PillarBoxes(boxes, inside_share, pixel_share)
        return cls(outlines, cells, PillarBoxes(strips, *in_strips), shapes, owner, sums)


def _drawn(
    views: Sequence[PixelView], lattice_ground: Floats, body: BodyConfig
) -> Iterator[tuple[Ints, Spans, Floats]]:
    """Outlines of all pillars, one view after the other."""
    heights = np.repeat(body.heights, len(lattice_ground))
    places, widths = np.tile(lattice_ground, (len(body.heights), 1)), body.width_of(heights)
    for view in views:
        for begin in range(0, len(heights), _PILLARS_AT_ONCE):
            block = slice(begin, begin + _PILLARS_AT_ONCE)
            yield view.outlines(places[block], heights[block], widths[block])


@kernel
def _fill_boxes(outlines: PackedOutlines, heights: int, cells: int, boxes: Shorts, strips: Shorts) -> None:
    """Widen boxes (view, cell, 4) and strips (view, strip, 4), empty before, around the outlines."""
    for i in range(len(outlines.first)):
        view, cell, row = i // (heights * cells), i % cells, outlines.first[i]
        box, strip = boxes[view, cell], strips[view, cell // STRIP_CELLS]
        for k in range(outlines.start[i], outlines.start[i + 1]):
            left, right = outlines.spans[k]
            if right > left:
                box[0], box[1] = min(box[0], left), min(box[1], row)
                box[2], box[3] = max(box[2], right), max(box[3], row + 1)
            row += 1
        if box[2] > 0:
            strip[0], strip[1] = min(strip[0], box[0]), min(strip[1], box[1])
            strip[2], strip[3] = max(strip[2], box[2]), max(strip[3], box[3])
