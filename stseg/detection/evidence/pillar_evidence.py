"""Evidence of unexplained pixels for the pillars of the birth lattice, with bounds that spare most sums.

The sum over a pillar's outline is at most its pixels times the lowest log-odds, plus the excess of the pixels of the
box around it. Pixels are summed only where all views together may be evidence enough. Where a strip's box shows nothing
else, the sum is the number of pixels times the lowest.
"""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.pixel_lattice import STRIP_CELLS, PillarBoxes, PixelLattice
from stseg.detection.evidence.unexplained_pixels import QUANTA_PER_NAT, UnexplainedPixels, more_inside, sum_to, unsigned
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

_ROUNDING_MARGIN = 1e-6
"""Above the rounding error of a bound, nats."""


def fill_scores(
    pixels: UnexplainedPixels,
    lattice: PixelLattice,
    probes: Ints,
    others: Ints,
    minimum_probe_score: float,
    weight: float,
    score: Floats,
) -> None:
    """Add the evidence of unexplained pixels to the score (height, cell) of pillars, nats; -inf where it cannot matter.

    Where all `probes` (heights) of a cell score at most `minimum_probe_score`, all its heights are -inf, without
    evaluating the `others`; so are other heights that score 0 or less, and cells where all heights do by all that
    pixels may add.
    """
    best, strips = score.max(0) + _ROUNDING_MARGIN, np.arange(lattice.strips.box.shape[1])
    in_strips = _bounds(pixels, lattice.strips, strips, weight).sum(0).repeat(STRIP_CELLS)
    cells = np.flatnonzero(best + in_strips[: len(best)] > 0)
    bound = _bounds(pixels, lattice.cells, cells, weight)
    matters = best[cells] + bound.sum(0) > 0
    cells, bound = cells[matters], bound[:, matters]
    open_score, added = score[:, cells], bound.sum(0)
    _add_evidence(pixels, lattice, cells, probes, minimum_probe_score, weight, bound, added, open_score)
    open_score[np.ix_(others, (open_score[probes] <= minimum_probe_score).all(0))] = -np.inf
    _add_evidence(pixels, lattice, cells, others, 0.0, weight, bound, added, open_score)
    score[:] = -np.inf
    score[:, cells] = open_score


def _bounds(pixels: UnexplainedPixels, pillars: PillarBoxes, chosen: Ints, weight: float) -> Floats:
    """The most that each view adds to the score of any pillar of the chosen cells or strips (k,), (view, k), nats."""
    bound = np.zeros((len(pillars.box), len(chosen)))
    _fill_bounds(pixels, pillars, chosen, weight, bound)
    return bound


@kernel
def _fill_bounds(
    every_pixel: UnexplainedPixels, every_pillar: PillarBoxes, chosen: Ints, weight: float, bound: Floats
) -> None:
    """Fill bound (view, k), 0 before; see `_bounds`.

    That is at most the log-odds above 0 around the pillars that no member explains, and at most the lowest log-odds of
    all that lies on the raster, with the excess.
    """
    pixels, pillars = pointed(every_pixel), pointed(every_pillar)
    for view in range(len(bound)):  # cells of one view after the other lie side by side in memory
        boxes, lowest = pillars.box[view], pixels.extremes[view, 0]
        for k, one in enumerate(chosen):
            if boxes[one, 2] > 0:
                inside = pillars.inside_share[view, one] if lowest < 0 else 1.0
                share = pillars.pixel_share[view, one] * (1 / QUANTA_PER_NAT)
                more = inside * lowest + more_inside(view, one, boxes, pixels.above) * share
                bound[view, k] = weight * min(more, more_inside(view, one, boxes, pixels.gain_above) * share)


@kernel
def _add_evidence(
    every_pixel: UnexplainedPixels,
    every_pillar: PixelLattice,
    cells: Ints,
    heights: Ints,
    least: float,
    weight: float,
    bound: Floats,
    added: Floats,
    score: Floats,
) -> None:
    """Add the evidence of all views to the score (height, k) of some heights; -inf where it is not above the least.

    Views, each of which adds at most `bound` (view, k) in the cells (k,), all together `added` (k,), follow each other:
    pillars that the next ones cannot raise above the least are dropped.
    """
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    most = score + added
    for view in range(len(bound)):
        for height in heights:
            for k, cell in enumerate(cells):
                if most[height, k] + _ROUNDING_MARGIN > least:
                    i = (view * len(score) + height) * every_pillar.cells.box.shape[1] + cell
                    evidence = pillar_evidence(view, cell, i, pixels, lattice, weight)
                    most[height, k] += evidence - bound[view, k]
                    score[height, k] += evidence
    for height in heights:
        for k in range(len(cells)):
            if most[height, k] + _ROUNDING_MARGIN <= least:
                score[height, k] = -np.inf


@part
def pillar_evidence(
    view: int, cell: int, i: int, pixels: UnexplainedPixels, lattice: PixelLattice, weight: float
) -> float:
    """A view's evidence for the i-th pillar of all, in a cell, nats."""
    outlines, total = lattice.outlines, 0.0
    if outlines.inside[i] == 0:
        return 0.0
    if not pixels.is_shown[view, cell // STRIP_CELLS]:
        return float(weight * (pixels.extremes[view, 0] * outlines.inside[i]) / outlines.area[i])
    at, row = np.uint64(view), np.uint64(outlines.first[i])
    for k in range(np.uint64(outlines.start[i]), np.uint64(outlines.start[i + 1])):
        start, stop = unsigned(outlines.spans[k, 0]), unsigned(outlines.spans[k, 1])
        if stop > pixels.summed_to[at, row]:
            sum_to(stop, at, row, lattice.shapes[view, 1], pixels)
        total += pixels.left_of[at, row, stop] - pixels.left_of[at, row, start]
        row += np.uint64(1)
    return float(weight * total / outlines.area[i])
