"""Fusion of what the views say of each cell (KS09 eqs 4 to 7; METHODS 3, 4).

Views are independent given that a cell is occupied, so likelihoods multiply (KS09 eqs 1 to 4). Views weigh less the
more cluttered they are (eqs 5, 6), and only views that see the cell speak (eq. 7):

    log P(X | x_1..x_n) = n_vis sum_i w_i log L_i,    w_i = (1 / C_i) / sum over the views that see the cell of 1 / C_k

This is the *synergy map*. It leaves the level from which a cell is occupied open, and that level depends on how many
views see the cell. The calibrated form is the log-odds

    u = k n_vis sum_i w_i log[ ((1 - m) L_i + m (1 - L_i)) / (b L_i + (1 - b)(1 - L_i)) ] + log(pi / (1 - pi))

with m, how often a body is missed, b, how often the ray of an empty cell meets foreground, and pi, how often a cell is
occupied. b and pi differ between cells within reach of a person and others: rays that pass a person closely often meet
that person. k, 0..1, is how many independent looks at a cell one view is worth: views err together where a limb leaves
the pillar or a person stands a little aside. Both are sums of terms that depend on one view's L_i alone, so both are
the same kernels with other tables of terms. L_i is the mean over the cell's footprint, taken before the logarithm.

A view that sees only a share a_i of the footprint past nearer people counts as that much of a view: w_i is multiplied
by a_i, and n_vis = sum_i a_i.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Bytes, Ints, Singles
from stseg.geometry.summed_area import TOP, Levels


class ErrorRates(NamedTuple):
    """How a view errs (METHODS 4).

    Attributes
    ----------
    miss
        m: how often a cell of a body is missed.
    clutter
        b: how often the ray of an empty cell meets foreground where nobody is near.
    near_clutter
        b of the empty cells within reach of a person.
    """

    miss: float
    clutter: float
    near_clutter: float


def log_odds_terms(rates: ErrorRates) -> Singles:
    """log[ ((1 - m) L + m (1 - L)) / (b L + (1 - b)(1 - L)) ] of each level, nats.

    Returns
    -------
    float32 (2, TOP + 1)
        Where nobody is near, and within reach of a person.
    """
    likelihood = np.arange(TOP + 1) / TOP
    body = (1 - rates.miss) * likelihood + rates.miss * (1 - likelihood)
    clutter = np.array([[rates.clutter], [rates.near_clutter]])
    empty = clutter * likelihood + (1 - clutter) * (1 - likelihood)
    return np.log(body / empty).astype(np.float32)


def synergy_terms(least: float) -> Singles:
    """log L of each level, L at least `least` (L_min of METHODS 2), nats, float32 (2, TOP + 1): the same everywhere."""
    likelihood = np.arange(TOP + 1) / TOP
    return np.tile(np.log(np.maximum(likelihood, least)).astype(np.float32), (2, 1))


class Accumulator:
    """What the views said so far of each cell of a frame.

    Attributes
    ----------
    weighted, weights, count : float32 (plane, y, x)
        Sums of w_i a_i times term, of w_i a_i, and of a_i.
    """

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.weighted, self.weights = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self.count = np.zeros(shape, np.float32)

    def add(self, levels: Levels, terms: Singles, weight: float, share: Singles, faith: Singles, near: Ints) -> None:
        """Add one view; see `add_terms`."""
        add_terms(levels, terms, np.float32(weight), share, faith, near, self.weighted, self.weights, self.count)

    def total(self, views: Bytes, near: Ints, looks: float, priors: tuple[float, float]) -> Singles:
        """k n_vis sum_i w_i term_i and the prior, nats, float32 (plane, y, x); see `fill_total`."""
        total = np.empty(self.weighted.shape, np.float32)
        prior, prior_beside = np.float32(priors[0]), np.float32(priors[1])
        fill_total(self.weighted, self.weights, self.count, views, near, np.float32(looks), prior, prior_beside, total)
        return total


@kernel
def add_terms(
    levels: Levels,
    terms: Singles,
    weight: np.float32,
    share: Singles,
    faith: Singles,
    near: Ints,
    weighted: Singles,
    weights: Singles,
    count: Singles,
) -> None:
    """Add one view's terms to the frame's sums; see `Accumulator`.

    Parameters
    ----------
    levels : int16 (plane, y, x)
        Mean likelihood of each cell, or UNSEEN.
    terms : float32 (2, TOP + 1)
        The term of each level where nobody is near, and where somebody is, nats.
    weight
        1 / C_i, in any scale.
    share : float32 (plane, y, x)
        a_i, 0..1.
    faith : float32 (plane, y, x)
        What the term is multiplied by besides, 0..1, without being worth less of a view.
    near : int64 (y, x)
        The person near each cell, -1 for nobody.
    """
    level, seen, trusted, person = levels.reshape(-1), share.reshape(-1), faith.reshape(-1), near.reshape(-1)
    to_weighted, to_weights, to_count = weighted.reshape(-1), weights.reshape(-1), count.reshape(-1)
    for c in range(len(level)):
        if level[c] >= 0:
            part = weight * seen[c]
            beside = 1 if person[c % len(person)] >= 0 else 0
            to_weighted[c] += part * trusted[c] * terms[beside, level[c]]
            to_weights[c] += part
            to_count[c] += seen[c]


@kernel
def fill_total(
    weighted: Singles,
    weights: Singles,
    count: Singles,
    views: Bytes,
    near: Ints,
    looks: np.float32,
    prior: np.float32,
    prior_beside: np.float32,
    total: Singles,
) -> None:
    """Fill total (plane, y, x): nan where no view's image holds the cell, the prior where all are hidden.

    Parameters
    ----------
    views : uint8 (plane, y, x)
        Number of views whose image holds the cell.
    near : int64 (y, x)
        The person near each cell, -1 for nobody.
    looks
        k.
    prior, prior_beside
        log(pi / (1 - pi)) where nobody is near, and within reach of a person.
    """
    for z in range(views.shape[0]):
        for y in range(views.shape[1]):
            for x in range(views.shape[2]):
                if views[z, y, x] == 0:
                    total[z, y, x] = np.nan
                    continue
                total[z, y, x] = prior if near[y, x] < 0 else prior_beside
                if weights[z, y, x] > 0:
                    total[z, y, x] += looks * count[z, y, x] * weighted[z, y, x] / weights[z, y, x]
