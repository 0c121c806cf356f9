"""How tall and how wide people are, by HW12's refinement (eqs 25 to 28; METHODS 8).

E step: the sizes of one person on a lattice around those of people in general, heights first, then widths. Over all
that the lattice's pillars cover, the person's own pixels speak for a pillar inside it and against it outside,
background speaks against it inside, other people's pixels say nothing (they may hide anything). A pixel that is
foreground with probability o is o their own and 1 - o background. Less what is the same for all pillars R of the
lattice, one view says of each

    looks * sum_R (2 o OWN + (1 - o) BACKGROUND) / area of a body of mean size     nats.

HW12 averages over R, which never rewards a pillar for covering more of the person. Its weight of the background is lost
in the scan; here it is what makes a pixel that is half foreground say nothing, so that edges lie where people's do. A
box tells the size by how the pillar fits it. M step: the frame is searched again with the sizes found
(`ghosts.explain`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from stseg.arrays import Floats, Ints
from stseg.config import GhostConfig
from stseg.ghosts.boxes import fill_match
from stseg.ghosts.own import WORST, Own
from stseg.ghosts.pool import Pool
from stseg.ghosts.views import BoxView, PixelView, Sight, View

OWN, BACKGROUND = 5.0, -10.0
"""Weights of labels (eq. 27)."""
_WITHIN = 3.0
"""How far the lattice goes, standard deviations of people's sizes."""
_STEPS = 13


@dataclass(frozen=True)
class Sizes:
    """Sizes of people as means and variances, each float64 (n,); metres and square metres."""

    height: Floats
    height_variance: Floats
    width: Floats
    width_variance: Floats

    @classmethod
    def of_anybody(cls, number: int, config: GhostConfig) -> Sizes:
        """Before anybody was looked at."""
        height, width = (config.height_mean, config.height_spread), (config.width_mean, config.width_spread)
        return cls(*(np.full(number, value) for mean, spread in (height, width) for value in (mean, spread**2)))

    def at(self, chosen: Sequence[int] | Ints) -> Sizes:
        """Those of the chosen, in that order."""
        index = np.asarray(chosen, int)
        return Sizes(self.height[index], self.height_variance[index], self.width[index], self.width_variance[index])

    def put(self, chosen: Ints, others: Sizes) -> None:
        """Take others' sizes for the chosen."""
        self.height[chosen], self.height_variance[chosen] = others.height, others.height_variance
        self.width[chosen], self.width_variance[chosen] = others.width, others.width_variance

    def told_apart_from(self, prior: Sizes) -> Sizes:
        """What was measured, if these are posteriors with that prior; a variance is huge where nothing was."""
        return Sizes(
            *_apart(self.height, self.height_variance, prior.height, prior.height_variance),
            *_apart(self.width, self.width_variance, prior.width, prior.width_variance),
        )

    def with_prior(self, prior: Sizes) -> Sizes:
        """Posteriors of these measurements with a prior."""
        return Sizes(
            *_product(self.height, self.height_variance, prior.height, prior.height_variance),
            *_product(self.width, self.width_variance, prior.width, prior.width_variance),
        )


_NOTHING = 1e-6
"""Precision of a measurement that was none, one over square metres."""


def _apart(mean: Floats, variance: Floats, prior: Floats, prior_variance: Floats) -> tuple[Floats, Floats]:
    precision = np.maximum(1 / variance - 1 / prior_variance, _NOTHING)
    return prior + (mean - prior) / variance / precision, 1 / precision


def _product(mean: Floats, variance: Floats, other: Floats, other_variance: Floats) -> tuple[Floats, Floats]:
    share = other_variance / (variance + other_variance)
    return other + share * (mean - other), other_variance * (1 - share)


def measure(
    pool: Pool,
    views: Sequence[View],
    sights: Sequence[Sight | None],
    own: Sequence[Sequence[Own]],
    config: GhostConfig,
) -> Sizes:
    """The E step: posteriors of people's sizes after one frame, anybody's sizes the prior.

    Parameters
    ----------
    pool
        The people, with the sizes that they have so far.
    own
        For each person and view what is theirs.
    """
    found = Sizes.of_anybody(len(pool), config)
    steps = np.linspace(-_WITHIN, _WITHIN, _STEPS)
    heights, widths = config.height_mean + config.height_spread * steps, config.width_mean + config.width_spread * steps
    values = [None if sight is None else _label_values(sight) for sight in sights]
    for j in range(len(pool)):
        told = [
            _Told(view, sight, mine.box, view.row_sums(value, mine.pixels) if isinstance(view, PixelView) else value)
            for view, sight, value, mine in zip(views, sights, values, own[j], strict=True)
            if sight is not None and value is not None
        ]
        place = np.tile(pool.ground[j], (_STEPS, 1))
        fits = Pool(place, heights, np.full(_STEPS, pool.width[j]))
        found.height[j], found.height_variance[j] = _posterior(heights, _score(fits, told), steps)
        fits = Pool(place, np.full(_STEPS, found.height[j]), widths)
        found.width[j], found.width_variance[j] = _posterior(widths, _score(fits, told), steps)
    return found


class _Told(NamedTuple):
    """What one view shows of one person: a box (-1 for none), or label values of their pixels, summed along rows."""

    view: View
    sight: Sight
    box: int
    sums: Floats


def _label_values(sight: Sight) -> Floats:
    """What each pixel of a raster (v, u) says of a pillar that covers it, if it is open to the person."""
    own = expit(sight.raster.astype(float))
    return np.asarray(2 * OWN * own + BACKGROUND * (1 - own))


def _posterior(lattice: Floats, score: Floats, steps: Floats) -> tuple[float, float]:
    """Mean and variance of one size on the lattice, from what the views say of it, nats."""
    score = score - 0.5 * steps**2
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    mean = float(weight @ lattice)
    return mean, float(weight @ (lattice - mean) ** 2)


def _score(fits: Pool, told: Sequence[_Told]) -> Floats:
    """What all views say of one person's pillars, nats, float64 (pillar,)."""
    score = np.zeros(len(fits))
    for view, sight, box, sums in told:
        if isinstance(view, BoxView) and box >= 0:
            score += _fit(view, sight, box, fits)
        if isinstance(view, PixelView):
            first, spans, area = view.outlines(fits.ground, fits.height, fits.width)
            score += view.means(sums, first, spans, np.full(len(fits), area.mean()))
    return score


def _fit(view: BoxView, sight: Sight, box: int, fits: Pool) -> Floats:
    """How well pillars fit a box, nats, float64 (pillar,)."""
    width, height = map(float, view.camera.size)
    match = np.empty((len(fits), 1))
    bodies = view.table.boxes_of(fits.ground, fits.height, fits.width)
    fill_match(bodies, sight.edges[box : box + 1], sight.belief[box : box + 1], width, height, match)
    return np.maximum(match[:, 0], WORST)
