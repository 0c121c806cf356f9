"""Evidence of unexplained pixels for the pillars of the birth lattice, with bounds that spare most sums.

The sum over a pillar's outline is at most its pixels times the lowest log-odds, plus the excess of the pixels of the
box around it. Pixels are summed only where all views together may be evidence enough. Where a strip's box shows nothing
else, the sum is the number of pixels times the lowest.
"""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.pixel_lattice import STRIP_CELLS, PixelLattice
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
    bound = np.zeros(lattice.pixel_share.shape)
    _fill_bounds(pixels, lattice, weight, bound)
    added = bound.sum(0)
    score[:, score.max(0) + added + _ROUNDING_MARGIN <= 0] = -np.inf
    _add_evidence(pixels, lattice, probes, minimum_probe_score, weight, bound, added, score)
    score[np.ix_(others, (score[probes] <= minimum_probe_score).all(0))] = -np.inf
    _add_evidence(pixels, lattice, others, 0.0, weight, bound, added, score)


@kernel
def _fill_bounds(every_pixel: UnexplainedPixels, every_pillar: PixelLattice, weight: float, bound: Floats) -> None:
    """Fill bound (view, cell), 0 before, with the most that a view adds to the score of any pillar of a cell, nats.

    That is at most the log-odds above 0 around the cell that no member explains, and at most the lowest log-odds of all
    that lies on the raster, with the excess.
    """
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    for view in range(len(bound)):  # cells of one view after the other lie side by side in memory
        boxes, lowest = lattice.boxes[view], pixels.extremes[view, 0]
        for cell in range(bound.shape[1]):
            if boxes[cell, 2] > 0:
                share = lattice.pixel_share[view, cell] * (1 / QUANTA_PER_NAT)
                more = lattice.inside_share[view, cell] * lowest + more_inside(view, cell, boxes, pixels.above) * share
                bound[view, cell] = weight * min(more, more_inside(view, cell, boxes, pixels.gain_above) * share)


@kernel
def _add_evidence(
    every_pixel: UnexplainedPixels,
    every_pillar: PixelLattice,
    heights: Ints,
    least: float,
    weight: float,
    bound: Floats,
    added: Floats,
    score: Floats,
) -> None:
    """Add the evidence of all views to the score (height, cell) of some heights; -inf where it is not above the least.

    Views, each of which adds at most `bound` (view, cell), all together `added` (cell,), follow each other: pillars
    that the next ones cannot raise above the least are dropped.
    """
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    views, cells = bound.shape
    most = score + added
    for view in range(views):
        for height in heights:
            for cell in range(cells):
                if most[height, cell] + _ROUNDING_MARGIN > least:
                    i = (view * len(score) + height) * cells + cell
                    evidence = pillar_evidence(view, cell, i, pixels, lattice, weight)
                    most[height, cell] += evidence - bound[view, cell]
                    score[height, cell] += evidence
    for height in heights:
        for cell in range(cells):
            if most[height, cell] + _ROUNDING_MARGIN <= least:
                score[height, cell] = -np.inf


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
