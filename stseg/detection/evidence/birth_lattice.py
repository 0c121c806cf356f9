"""The birth lattice: places on the ground where the unexplained evidence may show a further person."""

import numpy as np

from stseg.arrays import Flags, Floats
from stseg.detection.evidence.candidate_evidence import peaks
from stseg.detection.evidence.pillar_evidence import fill_scores
from stseg.detection.evidence.unexplained_pixels import UnexplainedPixels
from stseg.detection.search.map_estimate import MapEstimate
from stseg.geometry import Grid
from stseg.records.candidates import Candidates

_MINIMUM_PROBE_SCORE = -4.0
"""Score of the probe heights below which no other height makes a candidate, nats."""
_SIMILAR_HEIGHT_RATIO = 0.8
"""Ratio of two heights above which their pillars have similar scores."""


def lattice(grid: Grid, spacing: float) -> Floats:
    """Ground points of a lattice over a grid's rectangle, float64 (y, x, 2), metres."""
    x = np.arange(grid.x[0] + spacing / 2, grid.x[1], spacing)
    y = np.arange(grid.y[0] + spacing / 2, grid.y[1], spacing)
    return np.stack(np.meshgrid(x, y), -1)


def lattice_candidates(estimate: MapEstimate, lattice_ground: Floats, is_open: Flags | None = None) -> Candidates:
    """Peaks of the lattice's score by the evidence that an estimate leaves unexplained.

    `lattice_ground` float64 (y, x, 2) is that of the views, metres; `is_open` bool (y, x) where peaks may lie, by
    default everywhere. Pixels are summed at one or two heights first, and at the others where those score well.
    """
    evidence = estimate.evidence
    prior, (rows, columns) = evidence.prior, lattice_ground.shape[:2]
    heights = np.asarray(prior.body.heights)
    score = evidence.box_lattice.score(estimate.box_assignment).reshape(len(heights), rows * columns)
    if is_open is not None:
        score[:, ~is_open.ravel()] = -np.inf
    if len(evidence.rasters):
        pixels = UnexplainedPixels.of(evidence.rasters, estimate.owners, evidence.lattice, evidence.extremes)
        probes = _probes(heights)
        others, weight = np.delete(np.arange(len(heights)), probes), prior.config.effective_observations
        fill_scores(pixels, evidence.lattice, np.array(probes), others, _MINIMUM_PROBE_SCORE, weight, score)
    return peaks(score.reshape(-1, rows, columns), lattice_ground, heights, prior.body.width_of(heights))


def _probes(heights: Floats) -> list[int]:
    """Indices of the heights that are tried first: the middle one, and a small one where they differ much."""
    middle, small = len(heights) // 2, len(heights) // 4
    return [middle, small] if heights[small] < _SIMILAR_HEIGHT_RATIO * heights[middle] else [middle]
