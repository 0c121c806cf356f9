"""Fit of boxes to pillars, and occlusion of pillars by each other.

A box is compared with the box of the pillar, both clipped to the image: its middle, its width, its upper edge, and its
lower edge. Nearer people and furniture hide feet: with probability h a lower edge lies anywhere over the body's height,
otherwise at the feet. Of the two the likelier counts, so a box that ends far above the feet says nothing of them, and
one that ends near them says it sharply. There is one h where another box covers the feet
(`stseg.bodies.covered_feet`), and one elsewhere. They and the noise differ from detector to detector, and are learned
(`stseg.noise.box_noise_estimate`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.pillars import LEVELS, PROFILE, BodyTable, box_of, fill_discs, fill_levels
from stseg.kernels.accelerate import kernel, part

MIDDLE_OFFSET, WIDTH_OFFSET, UPPER_EDGE, LOWER_EDGE, FEET_LIMIT = range(5)
"""Compared quantities of a box: middle, width, upper and lower edge; and the offset above which feet are hidden."""
TOLERANCE = np.array([0.06, 0.15, 0.045, 0.06])
"""Tolerances of the four in a box of score 1 before learning, shares of the body's height."""
EDGE_GRAIN = 2.0 / TOLERANCE
"""Pixels added to the height of which tolerances are shares, for a grid of 2 pixels: a sharper detector's is finer."""
MATCH_LIMIT = 4.5
"""Offsets of the middle beyond this many tolerances exclude a match."""
LEAST_PIXEL_HEIGHT = 8.0
"""Shares are taken of at least this height, pixels."""
Edges = Floats | tuple[float, float, float, float]
"""left, top, right, bottom, pixels."""


class ViewBoxes(NamedTuple):
    """Boxes of one view."""

    edges: Floats
    """float64 (box, 4): left, top, right, bottom, pixels, within the image."""
    tolerance: Floats
    """float64 (box, 5): tolerances and `FEET_LIMIT` of each box; see `half_square` and `BoxNoise`."""
    belief: Floats
    """float64 (box,): belief in each box; see `half_square` and `BoxNoise`."""
    width: float
    height: float
    """Size of the image, pixels."""


@part
def half_square(body: Edges, box: Floats, tolerance: Floats, width: float, height: float) -> float:
    """Half the squared Mahalanobis distance of a box from a pillar's box, both left, top, right, bottom in pixels.

    `tolerance` float64 (5,) holds standard deviations, and the limit at which feet are taken for hidden: shares of the
    body's height in the image and its grain.
    """
    left, right = min(max(body[0], 0.0), width - 1.0), min(max(body[2], 0.0), width - 1.0)
    if right <= left:
        return np.inf
    tall = max(body[3] - body[1], LEAST_PIXEL_HEIGHT)
    middle = ((left + right) - (box[0] + box[2])) / 2.0 / (tall + EDGE_GRAIN[MIDDLE_OFFSET]) / tolerance[MIDDLE_OFFSET]
    if not abs(middle) <= MATCH_LIMIT:  # most pairs are decided here
        return np.inf
    _, wide, head, feet = _offsets(body, box, width, height)
    if np.isnan(wide):
        return np.inf
    wide /= tolerance[WIDTH_OFFSET]
    head /= tolerance[UPPER_EDGE]
    feet = min(feet, tolerance[FEET_LIMIT]) / tolerance[LOWER_EDGE]
    return float(0.5 * (middle * middle + wide * wide + head * head + feet * feet))


@kernel
def fill_offsets(bodies: Floats, boxes: Floats, width: float, height: float, offsets: Floats) -> None:
    """Fill offsets (n, 4): how far each box (n, 4) is from its pillar's (n, 4): middle, width, upper and lower edge.

    Shares as the tolerances of `half_square`; nan where the pillar is not in the image.
    """
    for i in range(len(bodies)):
        offsets[i, 0], offsets[i, 1], offsets[i, 2], offsets[i, 3] = _offsets(bodies[i], boxes[i], width, height)


@part
def _offsets(body: Edges, box: Floats, width: float, height: float) -> tuple[float, float, float, float]:
    left, right = min(max(body[0], 0.0), width - 1.0), min(max(body[2], 0.0), width - 1.0)
    top, bottom = min(max(body[1], 0.0), height - 1.0), min(max(body[3], 0.0), height - 1.0)
    if right <= left or bottom <= top:
        return np.nan, np.nan, np.nan, np.nan
    tall = max(body[3] - body[1], LEAST_PIXEL_HEIGHT)
    return (
        ((left + right) - (box[0] + box[2])) / 2.0 / (tall + EDGE_GRAIN[MIDDLE_OFFSET]),
        ((right - left) - (box[2] - box[0])) / (tall + EDGE_GRAIN[WIDTH_OFFSET]),
        (top - box[1]) / (tall + EDGE_GRAIN[UPPER_EDGE]),
        (bottom - box[3]) / (tall + EDGE_GRAIN[LOWER_EDGE]),
    )


@kernel
def fill_match(bodies: Floats, boxes: ViewBoxes, match: Floats) -> None:
    """Fill match (candidate, box): log-likelihood of each box given each pillar's box (candidate, 4)."""
    for i in range(len(bodies)):
        for b in range(len(boxes.edges)):
            match[i, b] = -np.inf
            if not np.isnan(bodies[i, 0]):
                square = half_square(bodies[i], boxes.edges[b], boxes.tolerance[b], boxes.width, boxes.height)
                match[i, b] = boxes.belief[b] - square


@kernel
def add_own_fits(
    table: BodyTable, patch: Floats, heights: Floats, box: Ints, boxes: ViewBoxes, least: float, score: Floats
) -> None:
    """Add to score (person, height, place) the log-likelihood of a person's box given the pillars of a patch, nats.

    `patch` float64 (person, place, 2) and `heights` float64 (person, height) are in metres; `box` int64 (person,) is
    the box of each, -1 for none: nothing is added. A fit counts as `least` at least.
    """
    levels, discs = np.empty((len(LEVELS), 6)), np.empty((len(PROFILE), 6))
    for j in range(len(box)):
        for place in range(patch.shape[1] if box[j] >= 0 else 0):
            fill_levels(table, patch[j, place, 0], patch[j, place, 1], levels)
            for k in range(heights.shape[1]):
                fill_discs(levels, heights[j, k], PROFILE, table.step, discs)
                body, b = box_of(discs, table.breadth), box[j]
                fit = boxes.belief[b] - half_square(body, boxes.edges[b], boxes.tolerance[b], boxes.width, boxes.height)
                score[j, k, place] += max(fit, least) if not np.isnan(body[0]) else least


@kernel
def fill_inside(bodies: Floats, width: float, height: float, inside: Floats) -> None:
    """Fill inside (candidate,): the share of each pillar's box (candidate, 4) that lies in the image."""
    for i in range(len(bodies)):
        inside[i] = 0.0
        if not np.isnan(bodies[i, 0]):
            wide = min(bodies[i, 2], width) - max(bodies[i, 0], 0.0)
            tall = min(bodies[i, 3], height) - max(bodies[i, 1], 0.0)
            whole = (bodies[i, 2] - bodies[i, 0]) * (bodies[i, 3] - bodies[i, 1])
            inside[i] = max(wide, 0.0) * max(tall, 0.0) / whole


EFFECTIVE_OBSERVATIONS = 0.5
"""Effective number of observations of one edge of a box: errors of edges and views are correlated."""
SCORE_KNOTS = np.array([0.05, 0.2, 0.4, 0.6, 0.8, 1.0])
"""Scores of the table; between them logarithms are interpolated."""
HIDDEN_FEET = np.array([0.1, 0.4])
"""Shares of boxes whose feet are hidden before learning: where no other box covers them, and where one does."""


@dataclass(frozen=True)
class BoxNoise:
    """Noise of a detector's boxes: standard deviations of their offsets at each knot of the score, float64 (knot, 4).

    One detector draws the sides of a box within 2 % of a body's height, another within 7 %; most are less exact where
    their score is lower. Errors of the edges of one box are correlated, and so are those of the views where a body is
    no pillar: an edge counts as half an observation. Its tolerance is wider than its standard deviation by the root of
    two, and a noisier box says less for the person that it fits, by half the logarithms of the ratios of its
    tolerances, and of the shares of boxes with feet. By the first guess, in which standard deviations grow with one
    over the root of the score, that is the logarithm of the score.

    The width is not learned: arms and strides change it, from frame to frame together, however sharp the detector is.
    """

    spread: Floats
    hidden_feet: Floats
    """float64 (2,): shares of boxes whose feet are hidden, 0..1: where no other box covers them, and where one does."""
    scale: float = 1.0
    """Factor of offsets and tolerances: low, long bodies err by more of their height (`BodyConfig.stoutness`)."""

    def of(self, score: Floats, covered: Flags) -> tuple[Floats, Floats]:
        """Boxes' tolerances float64 (box, 5), and what each says by itself, nats, float64 (box,).

        Scores are 0..1; `covered` bool (box,) says whether another box covers the feet.
        """
        lower, share = knots_of(score)
        logs, kind = np.log(self.spread), covered.astype(int)
        spread = np.exp(logs[lower] * (1 - share[:, None]) + logs[lower + 1] * share[:, None])
        tolerance, hidden = spread / np.sqrt(EFFECTIVE_OBSERVATIONS), self.hidden_feet[kind]
        odds = (1 - hidden) / (hidden * np.sqrt(2 * np.pi) * spread[:, LOWER_EDGE])
        limit = tolerance[:, LOWER_EDGE] * np.sqrt(np.log(np.maximum(odds, 1.0)))
        sharpness = np.log(TOLERANCE / tolerance).sum(-1) + np.log((1 - hidden) / (1 - HIDDEN_FEET[kind]))
        return np.column_stack([tolerance, limit]) * self.scale, EFFECTIVE_OBSERVATIONS * sharpness


def knots_of(score: Floats) -> tuple[np.ndarray, Floats]:
    """The knot below each score, int64 (box,), and how far on to the next it is, 0..1."""
    at = np.interp(score, SCORE_KNOTS, np.arange(len(SCORE_KNOTS)))
    lower = np.minimum(at.astype(int), len(SCORE_KNOTS) - 2)
    return lower, at - lower


PRIOR_NOISE = BoxNoise(TOLERANCE * np.sqrt(EFFECTIVE_OBSERVATIONS / SCORE_KNOTS)[:, None], HIDDEN_FEET)
"""Before anything is learned."""
