"""Evidence of unexplained pixels for the pillars of the birth lattice, at the cost of what these pixels show.

What a pillar's outline sums to is at most its pixels times the lowest log-odds, and what the pixels of the box around
it have more. Pixels are summed only where all views together may be evidence enough. Where a strip's box shows nothing
else, the sum is the number of pixels times the lowest.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.open_pixels import STEPS, OpenPixels, more_inside, place, sum_to
from stseg.detection.evidence.pixel_lattice import STRIP, PixelLattice
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

_ROUNDING = 1e-6
"""Above what rounding adds to a bound, nats."""


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
    """Add the evidence of unexplained pixels to the score (height, cell) of pillars, nats; -inf where it cannot matter.

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
            score[height, cell] = add_pillar_evidence(
                score[height, cell], hopeless, pillar, cell, score.size, pixels, lattice, weight, more, parts
            )
            best = max(best, score[height, cell])
        for height in others:
            pillar, before = cell * len(score) + height, score[height, cell]
            score[height, cell] = (
                add_pillar_evidence(before, 0.0, pillar, cell, score.size, pixels, lattice, weight, more, parts)
                if best > hopeless
                else -np.inf
            )


@part
def fill_around(cell: int, pixels: OpenPixels, lattice: PixelLattice, more: Floats) -> None:
    """Fill more (view,) with a bound of what pixels around a cell's outlines have more than the lowest, nats."""
    for view in range(len(more)):
        is_seen = lattice.boxes[view, cell, 2] > 0
        more[view] = more_inside(view, cell, lattice.boxes[view], pixels.above) * (1 / STEPS) if is_seen else 0.0


@part
def add_pillar_evidence(
    before: float, least: float, pillar: int, cell: int, every: int, pixels: OpenPixels, lattice: PixelLattice,
    weight: float, more: Floats, parts: Floats,
) -> float:  # fmt: skip
    """A score with the evidence of all views for a pillar, one of `every` in each view; -inf where not above the least.

    `more` is that of `fill_around`. Fills parts (view,) with the evidence of each, nats.
    """
    most = before
    for view in range(len(parts)):
        parts[view] = _evidence_bound(view, view * every + pillar, pixels, lattice, weight, more[view])
        most += parts[view]
    total = before
    for view in range(len(parts)):
        if most + _ROUNDING <= least:
            return -np.inf
        most -= parts[view]
        parts[view] = _pillar_evidence(view, view * every + pillar, cell, pixels, lattice, weight)
        most += parts[view]
        total += parts[view]
    return total


@part
def _evidence_bound(view: int, i: int, pixels: OpenPixels, lattice: PixelLattice, weight: float, more: float) -> float:
    """Upper bound of a view's evidence for the i-th pillar of all, nats."""
    inside, lowest = lattice.outlines.inside[i], pixels.extremes[view, 0]
    if inside == 0:
        return 0.0
    most = inside * lowest + min(more, inside * (max(pixels.extremes[view, 1], 0.0) - lowest))
    return float(weight * most / lattice.outlines.area[i])


@part
def _pillar_evidence(view: int, i: int, cell: int, pixels: OpenPixels, lattice: PixelLattice, weight: float) -> float:
    """A view's evidence for the i-th pillar of all, nats."""
    outlines, total = lattice.outlines, 0.0
    if outlines.inside[i] == 0:
        return 0.0
    if not pixels.is_shown[view, cell // STRIP]:
        return float(weight * (pixels.extremes[view, 0] * outlines.inside[i]) / outlines.area[i])
    at, row = np.uint64(view), np.uint64(outlines.first[i])
    for k in range(np.uint64(outlines.start[i]), np.uint64(outlines.start[i + 1])):
        start, stop = place(outlines.spans[k, 0]), place(outlines.spans[k, 1])
        if stop > pixels.known[at, row]:
            sum_to(stop, at, row, lattice.shapes[view, 1], pixels)
        total += pixels.left_of[at, row, stop] - pixels.left_of[at, row, start]
        row += np.uint64(1)
    return float(weight * total / outlines.area[i])
