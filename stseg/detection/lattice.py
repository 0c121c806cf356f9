"""The birth lattice: places on the ground where the evidence that nobody explains yet may show a further person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats
from stseg.detection.evidence import peaks
from stseg.detection.map_estimate import MapEstimate
from stseg.detection.open_pixels import OpenPixels
from stseg.detection.views import PixelView
from stseg.geometry import Grid
from stseg.model.candidates import Candidates

_HOPELESS = -4.0
"""Where the probed heights are worth less, no other height makes a candidate, nats."""
_ALIKE = 0.8
"""Ratio of two heights above which what one pillar shows tells of the other."""


def lattice(grid: Grid, spacing: float) -> Floats:
    """Ground points of a lattice over a grid's rectangle, float64 (y, x, 2), metres."""
    x = np.arange(grid.x[0] + spacing / 2, grid.x[1], spacing)
    y = np.arange(grid.y[0] + spacing / 2, grid.y[1], spacing)
    return np.stack(np.meshgrid(x, y), -1)


def lattice_candidates(estimate: MapEstimate, lattice_ground: Floats) -> Candidates:
    """Peaks of the lattice's score by the evidence that an estimate leaves unexplained.

    Pixels are summed at one or two heights first, and at the others only where those are not all hopeless.
    `lattice_ground` float64 (y, x, 2) is that of the views, metres.
    """
    evidence, unexplained = estimate.evidence, estimate.unexplained()
    body, (rows, columns) = evidence.prior.body, lattice_ground.shape[:2]
    heights = np.asarray(body.heights)
    score = np.repeat(evidence.prior.log_height(heights)[:, None], rows * columns, 1)
    shown: list[tuple[PixelView, OpenPixels]] = []
    seen = zip(evidence.views, evidence.observations, evidence.box_lattices, unexplained, strict=True)
    for view, observation, boxes, free in seen:
        if boxes is not None:
            score += boxes.score(free)
        elif isinstance(view, PixelView) and observation is not None:
            shown.append((view, view.open_pixels(observation, free)))
    if shown:
        _add_pixels(shown, _probes(heights), score)
    return peaks(score.reshape(-1, rows, columns), lattice_ground, heights, body.width_of(heights))


def _probes(heights: Floats) -> list[int]:
    """Heights that show whether a place is worth a look: the middle one, and a small one where they differ much."""
    middle, small = len(heights) // 2, len(heights) // 4
    return [middle, small] if heights[small] < _ALIKE * heights[middle] else [middle]


def _add_pixels(shown: Sequence[tuple[PixelView, OpenPixels]], probes: Sequence[int], score: Floats) -> None:
    """Add what pixels say of the lattice's pillars to score (height, cell); -inf where a height is not worth a look."""
    others = np.delete(np.arange(len(score)), probes)
    for view, pixels in shown:
        view.add_lattice_score(pixels, np.array(probes), view.lattice_cells, score)
    hopeless = score[probes].max(0) <= _HOPELESS
    worth = np.flatnonzero(~hopeless)
    for view, pixels in shown:
        view.add_lattice_score(pixels, others, worth, score)
    for height in others:
        score[height, hopeless] = -np.inf
