"""Fusion of the views' evidence on each cell (Khan and Shah 2009, eqs 4 to 7; docs/how-it-works.md, Fusion).

Views are independent given that a cell is occupied, so likelihoods multiply (eqs 1 to 4). Views weigh less the more
cluttered they are (eqs 5, 6), and only views that see the cell count (eq. 7):

    log P(X | x_1..x_n) = n_vis sum_i w_i log L_i,    w_i = (1 / C_i) / sum over the views that see the cell of 1 / C_k

This is the *synergy map*. It has no threshold of its own, and a suitable one depends on how many views see the cell.
The calibrated form is the log-odds

    u = k n_vis sum_i w_i log[ ((1 - m) L_i + m (1 - L_i)) / (b L_i + (1 - b)(1 - L_i)) ] + log(pi / (1 - pi))

with the miss rate m of a body, the rate b at which the ray of an empty cell meets foreground, and the share pi of
occupied cells. b and pi differ between cells within reach of a person and others: rays that pass a person closely often
meet that person. k, 0..1, is the effective number of observations of a view: views err together where a limb leaves the
pillar or a position is slightly wrong. Both are sums of terms that depend on one view's L_i alone, so both are the same
kernels with other tables of terms. L_i is the mean over the cell's footprint, taken before the logarithm.

A view that sees only a share a_i of the footprint past nearer people counts as that share of a view: w_i is multiplied
by a_i, and n_vis = sum_i a_i.
"""

from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Labels, Singles
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, Levels
from stseg.kernels.accelerate import kernel, part, wide_kernel

_CELLS_AT_ONCE = 256
"""Cells that are summed over all views before the next ones; a view that sees none of them costs nothing."""


class ErrorRates(NamedTuple):
    """Error rates of a view."""

    miss: float
    """m: how often a cell of a body is missed."""
    clutter: float
    """b: how often the ray of an empty cell near no person meets foreground."""
    near_clutter: float
    """b of the empty cells within reach of a person."""


class FrameTerms(NamedTuple):
    """Terms of the views of a frame at cells (n,)."""

    levels: Levels
    """int16 (view, n): mean likelihood of each cell, or UNSEEN."""
    share: Singles
    """float32 (view, n): a_i, 0..1: visible share of the footprint; of any value where the level is UNSEEN."""
    near_person: Labels
    """int32 (n,): the person near each cell, -1 for none."""
    terms: Singles
    """float32 (view, 2, TOP_LEVEL + 1): the term of each level near no person, and within reach of a person, nats."""
    weight: Singles
    """float32 (view,): 1 / C_i, in any scale."""
    confidence: Singles
    """float32 (view, person): further factor of the terms near each person, 0..1, which does not reduce the view's
    count."""


class Sums(NamedTuple):
    """Sums over the views of a frame at cells (n,)."""

    weighted: Singles
    weights: Singles
    shares: Singles
    """float32 (n,) each: sums of w_i a_i times term, of w_i a_i, and of a_i."""

    @classmethod
    def of(cls, views: FrameTerms, memory: Singles | None = None) -> Self:
        """Sums over all views, in memory float32 (3, n) if it is given."""
        sums = cls(*(np.empty((3, len(views.near_person)), np.float32) if memory is None else memory))
        fill_sums(views, sums)
        return sums

    def total(self, near_person: Labels, observations: float, priors: tuple[float, float]) -> Singles:
        """k n_vis sum_i w_i term_i and the prior of each cell, nats, float32 (n,); where all are hidden the prior.

        `near_person` int32 (n,) is that of `FrameTerms`, `observations` is k, and `priors` are log(pi / (1 - pi)) near
        no person and within reach of one.
        """
        total = np.empty(len(near_person), np.float32)
        fill_total(self, near_person, np.float32(observations), np.float32(priors[0]), np.float32(priors[1]), total)
        return total


@lru_cache(maxsize=64)  # rates change a few times a second
def log_odds_terms(rates: ErrorRates) -> Singles:
    """log[ ((1 - m) L + m (1 - L)) / (b L + (1 - b)(1 - L)) ] of each level, nats; not to be written to.

    Returns
    -------
    float32 (2, TOP_LEVEL + 1)
        Near no person, and within reach of a person.
    """
    likelihood = np.arange(TOP_LEVEL + 1) / TOP_LEVEL
    body = (1 - rates.miss) * likelihood + rates.miss * (1 - likelihood)
    clutter = np.array([[rates.clutter], [rates.near_clutter]])
    empty = clutter * likelihood + (1 - clutter) * (1 - likelihood)
    return np.log(body / empty).astype(np.float32)


@kernel
def fill_sums(views: FrameTerms, sums: Sums) -> None:
    """Fill sums with what all views see."""
    number, term = len(views.near_person), np.empty(_CELLS_AT_ONCE, np.float32)
    for first in range(0, number, _CELLS_AT_ONCE):
        cells = slice(first, min(first + _CELLS_AT_ONCE, number))
        weighted, weights, visible = sums.weighted[cells], sums.weights[cells], sums.shares[cells]
        weighted[:], weights[:], visible[:] = 0.0, 0.0, 0.0
        for i in range(len(views.weight)):
            weight, terms = views.weight[i], views.terms[i, 0]
            levels, shares, highest = views.levels[i, cells], views.share[i, cells], np.int16(UNSEEN)
            for c in range(len(levels)):
                highest = max(highest, levels[c])
            if highest == UNSEEN:
                continue
            for c in range(len(levels)):  # a loop of its own, so that the other becomes vector code
                term[c] = terms[np.uint32(max(levels[c], 0))]
            for c in range(len(levels)):
                share = shares[c] if levels[c] >= 0 else np.float32(0)
                weighted[c] += weight * share * term[c]
                weights[c] += weight * share
                visible[c] += share
    for c in range(number):
        if views.near_person[c] >= 0:
            sums.weighted[c] = _weighted_near_person(views, c)


@part
def _weighted_near_person(views: FrameTerms, c: int) -> np.float32:
    """Sum of w_i a_i times term of a cell within reach of a person."""
    weighted = np.float32(0)
    for i in range(len(views.weight)):
        level = views.levels[i, c]
        if level >= 0:
            weight = views.weight[i] * views.share[i, c]
            weighted += weight * views.confidence[i, views.near_person[c]] * views.terms[i, 1, level]
    return weighted


@wide_kernel
def fill_total(
    sums: Sums, near_person: Labels, observations: np.float32, prior: np.float32, near_prior: np.float32, total: Singles
) -> None:
    """Fill total (n,); see `Sums.total`."""
    for c in range(len(near_person)):
        weight = sums.weights[c] if sums.weights[c] > 0 else np.float32(1)
        mean = observations * sums.shares[c] * sums.weighted[c] / weight
        total[c] = (prior if near_person[c] < 0 else near_prior) + (mean if sums.weights[c] > 0 else np.float32(0))
