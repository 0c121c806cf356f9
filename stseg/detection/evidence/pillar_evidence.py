"""Evidence of unexplained pixels for the pillars of the birth lattice, with bounds that spare most sums.

The sum over a pillar's outline is at most its pixels times the lowest log-odds, plus the excess of the pixels of the
box around it. Pixels are summed only where all views together may be evidence enough. Where a strip's box shows nothing
else, the sum is the number of pixels times the lowest.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.pixel_lattice import STRIP_CELLS, PixelLattice
from stseg.detection.evidence.unexplained_pixels import QUANTA_PER_NAT, UnexplainedPixels, more_inside, sum_to, unsigned
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

_ROUNDING_MARGIN = 1e-6
"""Above the rounding error of a bound, nats."""


@kernel
def fill_scores(
    every_pixel: UnexplainedPixels,
    every_pillar: PixelLattice,
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
    pixels, lattice = pointed(every_pixel), pointed(every_pillar)
    more, parts = np.empty((2, len(every_pillar.shapes)))
    for cell in range(score.shape[1]):
        best = -np.inf
        fill_around(cell, pixels, lattice, more)
        if not _may_gain(cell, pixels, lattice, weight, score, more):
            score[:, cell] = -np.inf
            continue
        for height in probes:
            pillar = cell * len(score) + height
            score[height, cell] = add_pillar_evidence(
                score[height, cell], minimum_probe_score, pillar, cell, score.size, pixels, lattice, weight, more, parts
            )
            best = max(best, score[height, cell])
        for height in others:
            pillar, before = cell * len(score) + height, score[height, cell]
            score[height, cell] = (
                add_pillar_evidence(before, 0.0, pillar, cell, score.size, pixels, lattice, weight, more, parts)
                if best > minimum_probe_score
                else -np.inf
            )


@part
def _may_gain(
    cell: int, pixels: UnexplainedPixels, lattice: PixelLattice, weight: float, score: Floats, more: Floats
) -> bool:
    """Whether any height of a cell may score above 0; `more` is that of `fill_around`.

    A view adds at most the log-odds above 0 around the cell that no member explains, and at most the lowest log-odds
    of all that lies on the raster, with the excess.
    """
    before, added = -np.inf, _ROUNDING_MARGIN
    for height in range(len(score)):
        before = max(before, score[height, cell])
    for view in range(len(more)):
        is_open = pixels.is_open[view, cell // STRIP_CELLS] and lattice.boxes[view, cell, 2] > 0
        gain = more_inside(view, cell, lattice.boxes[view], pixels.gain_above) if is_open else np.int32(0)
        least = lattice.inside_share[view, cell] * pixels.extremes[view, 0]
        share = lattice.pixel_share[view, cell]
        added += min(least + more[view] * share, gain * (1 / QUANTA_PER_NAT) * share)
    return bool(before + weight * added > 0)


@part
def fill_around(cell: int, pixels: UnexplainedPixels, lattice: PixelLattice, more: Floats) -> None:
    """Fill more (view,) with a bound of the excess of the pixels around a cell's outlines over the lowest, nats."""
    for view in range(len(more)):
        is_seen = lattice.boxes[view, cell, 2] > 0
        more[view] = (
            more_inside(view, cell, lattice.boxes[view], pixels.above) * (1 / QUANTA_PER_NAT) if is_seen else 0.0
        )


@part
def add_pillar_evidence(
    before: float, least: float, pillar: int, cell: int, pillars: int, pixels: UnexplainedPixels, lattice: PixelLattice,
    weight: float, more: Floats, parts: Floats,
) -> float:  # fmt: skip
    """A score with the evidence of all views for a pillar; -inf where it is not above the least.

    `more` is that of `fill_around`. Fills parts (view,) with the evidence of each view, nats.
    """
    most = before
    for view in range(len(parts)):
        parts[view] = _evidence_bound(view, view * pillars + pillar, pixels, lattice, weight, more[view])
        most += parts[view]
    total = before
    for view in range(len(parts)):
        if most + _ROUNDING_MARGIN <= least:
            return -np.inf
        most -= parts[view]
        parts[view] = _pillar_evidence(view, view * pillars + pillar, cell, pixels, lattice, weight)
        most += parts[view]
        total += parts[view]
    return total


@part
def _evidence_bound(
    view: int, i: int, pixels: UnexplainedPixels, lattice: PixelLattice, weight: float, more: float
) -> float:
    """Upper bound of a view's evidence for the i-th pillar of all, nats."""
    inside, lowest = lattice.outlines.inside[i], pixels.extremes[view, 0]
    if inside == 0:
        return 0.0
    most = inside * lowest + min(more, inside * (max(pixels.extremes[view, 1], 0.0) - lowest))
    return float(weight * most / lattice.outlines.area[i])


@part
def _pillar_evidence(
    view: int, i: int, cell: int, pixels: UnexplainedPixels, lattice: PixelLattice, weight: float
) -> float:
    """A view's evidence for the i-th pillar of all, nats."""
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
