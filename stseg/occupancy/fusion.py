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

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Bytes, Ints, Singles
from stseg.geometry.summed_area import TOP, Levels


class ErrorRates(NamedTuple):
    """Error rates of a view.

    Attributes
    ----------
    miss
        m: how often a cell of a body is missed.
    clutter
        b: how often the ray of an empty cell near no person meets foreground.
    near_clutter
        b of the empty cells within reach of a person.
    """

    miss: float
    clutter: float
    near_clutter: float


class ViewTerms(NamedTuple):
    """What one view adds to a frame's sums.

    Attributes
    ----------
    levels : int16 (plane, y, x), or (n,) of some cells
        Mean likelihood of each cell, or UNSEEN.
    terms : float32 (2, TOP + 1)
        The term of each level near no person, and within reach of a person, nats.
    weight : float
        1 / C_i, in any scale.
    share : float32, as the levels
        a_i, 0..1: visible share of the footprint; undefined where the level is UNSEEN.
    confidence : float32 (y, x), or (n,)
        Further factor of the terms, 0..1, which does not reduce the view's count.
    """

    levels: Levels
    terms: Singles
    weight: np.float32
    share: Singles
    confidence: Singles


class Sums(NamedTuple):
    """Sums over the views of a frame.

    Attributes
    ----------
    weighted, weights, shares : float32 (plane, y, x), or (n,) of some cells
        Sums of w_i a_i times term, of w_i a_i, and of a_i.
    """

    weighted: Singles
    weights: Singles
    shares: Singles

    @classmethod
    def zero(cls, shape: tuple[int, ...]) -> Self:
        """Before any view."""
        return cls(*(np.zeros(shape, np.float32) for _ in range(3)))

    def total(self, views: Bytes, near: Ints, observations: float, priors: tuple[float, float]) -> Singles:
        """k n_vis sum_i w_i term_i and the prior, nats, float32 as the sums; see `fill_total`."""
        total = np.empty(self.weighted.shape, np.float32)
        prior, near_prior = np.float32(priors[0]), np.float32(priors[1])
        fill_total(self, views, near, np.float32(observations), prior, near_prior, total)
        return total


@lru_cache(maxsize=64)  # rates change a few times a second
def log_odds_terms(rates: ErrorRates) -> Singles:
    """log[ ((1 - m) L + m (1 - L)) / (b L + (1 - b)(1 - L)) ] of each level, nats; not to be written to.

    Returns
    -------
    float32 (2, TOP + 1)
        Near no person, and within reach of a person.
    """
    likelihood = np.arange(TOP + 1) / TOP
    body = (1 - rates.miss) * likelihood + rates.miss * (1 - likelihood)
    clutter = np.array([[rates.clutter], [rates.near_clutter]])
    empty = clutter * likelihood + (1 - clutter) * (1 - likelihood)
    return np.log(body / empty).astype(np.float32)


def synergy_terms(floor: float) -> Singles:
    """log max(L, floor) of each level, nats, float32 (2, TOP + 1): the same near people."""
    likelihood = np.arange(TOP + 1) / TOP
    return np.tile(np.log(np.maximum(likelihood, floor)).astype(np.float32), (2, 1))


@kernel
def add_terms(view: ViewTerms, near: Ints, sums: Sums) -> None:
    """Add one view's terms to the frame's sums; near int64 (y, x), or (n,), is the person near each, -1 for none."""
    level, share = view.levels.reshape(-1), view.share.reshape(-1)
    confidence, person = view.confidence.reshape(-1), near.reshape(-1)
    weighted, weights, count = sums.weighted.reshape(-1), sums.weights.reshape(-1), sums.shares.reshape(-1)
    for start in range(0, len(level), max(len(person), 1)):
        for place in range(len(person)):
            c = start + place
            if level[c] >= 0:
                weight = view.weight * share[c]
                near_person = 1 if person[place] >= 0 else 0
                weighted[c] += weight * confidence[place] * view.terms[near_person, level[c]]
                weights[c] += weight
                count[c] += share[c]


@kernel
def fill_total(
    sums: Sums,
    views: Bytes,
    near: Ints,
    observations: np.float32,
    prior: np.float32,
    near_prior: np.float32,
    total: Singles,
) -> None:
    """Fill total (plane, y, x), or (n,): nan where no view's image holds the cell, the prior where all are hidden.

    Parameters
    ----------
    views : uint8, as the sums
        Number of views whose image holds the cell.
    near : int64 (y, x), or (n,)
        The person near each cell, -1 for none.
    observations
        k.
    prior, near_prior
        log(pi / (1 - pi)) near no person, and within reach of a person.
    """
    held, person, flat = views.reshape(-1), near.reshape(-1), total.reshape(-1)
    weighted, weights, count = sums.weighted.reshape(-1), sums.weights.reshape(-1), sums.shares.reshape(-1)
    for start in range(0, len(held), max(len(person), 1)):
        for place in range(len(person)):
            c = start + place
            if held[c] == 0:
                flat[c] = np.nan
                continue
            flat[c] = prior if person[place] < 0 else near_prior
            if weights[c] > 0:
                flat[c] += observations * count[c] * weighted[c] / weights[c]
