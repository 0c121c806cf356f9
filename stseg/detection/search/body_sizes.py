"""Body heights and widths, by HW12's refinement (eqs 25 to 28).

E step: the sizes of one person on a lattice, heights first, then widths. Over all that the lattice's pillars cover, the
person's own pixels speak for a pillar inside it and against it outside, background speaks against it inside, other
people's pixels say nothing (they may hide anything). A pixel that is foreground with probability o is o own and 1 - o
background. Less what is the same for all pillars R of the lattice, one view says of each

    observations * sum_R (2 o OWN + (1 - o) BACKGROUND) / mean area of these pillars     nats,

the weights those of `stseg.bodies.views`, `observations` the effective number of them in one view.

HW12 averages over R, which never rewards a pillar for covering more of the person. Its weight of the background is
illegible; here it makes a pixel that is half foreground say nothing, so that edges lie where people's do. Of people in
boxes alone the height is found with the place (`refine`), and no width: a box's sides show arms and
strides. M step: the frame is searched again with the sizes found (`stseg.detection.search.frame_search`).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints, Shorts, Singles
from stseg.bodies.views import PixelView, View, ViewObservations
from stseg.config import BodyConfig
from stseg.detection.search.refine import EvidenceAssignment, RefinedPlaces
from stseg.records.sizes import Sizes, log_heavy_tailed

_LATTICE_SIZE = 25
"""Sizes on the lattice."""
_HEIGHTS = np.linspace(0.75, 2.19, _LATTICE_SIZE)
"""Heights of the lattice, metres, where the mean is that of people: children to the tallest."""
_WIDTHS = np.linspace(0.26, 0.86, _LATTICE_SIZE)
"""Widths of the lattice, metres: the slim to coats, bags and prams."""


def body_sizes(
    places: RefinedPlaces,
    width: Floats,
    views: Sequence[View],
    observations: ViewObservations,
    assignment: EvidenceAssignment,
    body: BodyConfig,
) -> Sizes:
    """E step: posteriors of people's sizes after one frame, under the population prior.

    `places` are those of people, and the heights found with them: all that boxes show. `width` float64 (n,) is theirs
    so far, metres, and `assignment` the boxes and pixels assigned to each.
    """
    found = Sizes.of_population(len(width), body)
    measured = [
        _PixelLabels(view, observation.label_values, owner)
        for view, observation, owner in zip(views, observations, assignment.pixels, strict=True)
        if isinstance(view, PixelView) and observation is not None
    ]
    if not measured or not len(width):
        return replace(found, height=places.height, height_variance=places.height_variance)
    each, all_steps = (len(width), 1), (1, _LATTICE_SIZE)
    heights = _HEIGHTS * (measured[0].view.body.height_mean / BodyConfig.height_mean)
    score = _score(
        places.ground, np.tile(heights, each), np.tile(width[:, None], all_steps), measured, assignment.number
    )
    height, height_variance = _posterior(heights, score, body.height_mean, body.height_spread)
    score = _score(
        places.ground, np.tile(height[:, None], all_steps), np.tile(_WIDTHS, each), measured, assignment.number
    )
    return Sizes(
        height, height_variance, *_posterior(_WIDTHS, score, body.width_of(height[:, None]), body.width_spread)
    )


class _PixelLabels(NamedTuple):
    """Label values of one view's pixels, and their assignment, both (v, u)."""

    view: PixelView
    values: Singles
    owner: Shorts


def _posterior(lattice: Floats, score: Floats, mean: Floats | float, spread: float) -> tuple[Floats, Floats]:
    """Mean and variance of each person's size on the lattice, from log-likelihoods (person, pillar), nats.

    Where all sizes are equally likely, those of the population: `mean`, perhaps a column of one each, and `spread`
    squared.
    """
    is_measured = np.ptp(score, axis=1) > 0
    score = score + log_heavy_tailed((lattice - mean) / spread)
    weight = np.exp(score - score.max(1, keepdims=True))
    weight /= weight.sum(1, keepdims=True)
    size = weight @ lattice
    variance = (weight * (lattice - size[:, None]) ** 2).sum(1)
    return np.where(is_measured, size, np.ravel(mean)), np.where(is_measured, variance, spread**2)


def _score(ground: Floats, heights: Floats, widths: Floats, measured: Sequence[_PixelLabels], number: Ints) -> Floats:
    """Log-likelihood in all views of people's pillars at their places (person, 2), nats, float64 (person, pillar)."""
    score, ground_of_each = np.zeros(heights.shape), np.repeat(ground[:, None], _LATTICE_SIZE, 1)
    pillars = measured[0].view.tried(ground_of_each, heights, widths)
    for view, values, owner in measured:
        sums, area = view.open_sums(values, owner, number, pillars)
        score += sums / np.maximum(area.mean(1, keepdims=True), 1.0)
    return score
