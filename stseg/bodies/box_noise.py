"""Noise of a detector's boxes: standard deviations of their offsets from bodies, by score.

One detector draws the sides of a box within 2 % of a body's height, another within 7 %; most are less exact where their
score is lower. So the standard deviations of a box's offsets (`box_fit`) are a table over the score. Errors
of the edges of one box are correlated, and so are those of the views where a body is no pillar: an edge counts as half
an observation. Its tolerance is wider than its standard deviation by the root of two, and a noisier box says less for
the person that it fits, by half the logarithms of the ratios of its tolerances. By the first guess, in which standard
deviations grow with one over the root of the score, that is the logarithm of the score.

The first guess is also the loosest: what fits worse than that is no error of edges but a box of another person. And the
width is not learned: arms and strides change it, from frame to frame together, however sharp the detector is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.bodies.box_fit import LOWER_EDGE_ABOVE, LOWER_EDGE_BELOW, TOLERANCE

EFFECTIVE_OBSERVATIONS = 0.5
"""Effective number of observations of one edge of a box: errors of edges and views are correlated."""
SCORE_KNOTS = np.array([0.05, 0.2, 0.4, 0.6, 0.8, 1.0])
"""Scores of the table; between them logarithms are interpolated."""


@dataclass(frozen=True)
class BoxNoise:
    """Standard deviations of boxes' offsets at each knot of the score, float64 (knot, 5)."""

    spread: Floats

    def of(self, score: Floats) -> tuple[Floats, Floats]:
        """Boxes' tolerances float64 (box, 5), and what each says by itself, nats, float64 (box,); scores are 0..1."""
        lower, share = knots_of(score)
        logs = np.log(self.spread)
        spread = np.exp(logs[lower] * (1 - share[:, None]) + logs[lower + 1] * share[:, None])
        tolerance = spread / np.sqrt(EFFECTIVE_OBSERVATIONS)
        return tolerance, EFFECTIVE_OBSERVATIONS * np.log(_sides(TOLERANCE) / _sides(tolerance)).sum(-1)


def knots_of(score: Floats) -> tuple[np.ndarray, Floats]:
    """The knot below each score, int64 (box,), and how far on to the next it is, 0..1."""
    at = np.interp(score, SCORE_KNOTS, np.arange(len(SCORE_KNOTS)))
    lower = np.minimum(at.astype(int), len(SCORE_KNOTS) - 2)
    return lower, at - lower


def _sides(spread: Floats) -> Floats:
    """The lower edge's two standard deviations as one, (..., 4)."""
    foot = (spread[..., LOWER_EDGE_BELOW] + spread[..., LOWER_EDGE_ABOVE]) / 2
    return np.concatenate([spread[..., :LOWER_EDGE_BELOW], foot[..., None]], -1)


PRIOR_NOISE = BoxNoise(TOLERANCE * np.sqrt(EFFECTIVE_OBSERVATIONS / SCORE_KNOTS)[:, None])
"""Before anything is learned."""
