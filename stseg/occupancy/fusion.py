"""Fusion of what the views say of each cell (KS09 eqs 4 to 7; METHODS 3, 4).

Views are independent given that a cell is occupied, so likelihoods multiply (KS09 eqs 1 to 4). Views weigh less the
more cluttered they are (eqs 5, 6), and only views that see the cell speak (eq. 7):

    log P(X | x_1..x_n) = n_vis sum_i w_i log L_i,    w_i = (1 / C_i) / sum over the views that see the cell of 1 / C_k

This is the *synergy map*. It leaves the level from which a cell is occupied open, and that level depends on how many
views see the cell. The calibrated form is the log-odds

    u = n_vis sum_i w_i log[ ((1 - m) L_i + m (1 - L_i)) / (b L_i + (1 - b)(1 - L_i)) ] + log(pi / (1 - pi))

with m, how often a body is missed, b, how often the ray of an empty cell meets foreground, and pi, how often a cell is
occupied. Both are sums of terms that depend on one view's L_i alone, so both are the same kernels with another table of
terms. L_i is the mean over the cell's footprint, taken before the logarithm.

A view that sees only a share a_i of the footprint past nearer people counts as that much of a view: w_i is multiplied
by a_i, and n_vis = sum_i a_i.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Bytes, Ints, Singles
from stseg.occupancy.tables import TOP, Levels


class Rates(NamedTuple):
    """How a view errs: m, how often a body is missed, and b, how often an empty ray meets foreground (METHODS 4)."""

    miss: float
    clutter: float


def log_odds_terms(rates: Rates) -> Singles:
    """log[ ((1 - m) L + m (1 - L)) / (b L + (1 - b)(1 - L)) ] of each level, nats, float32 (TOP + 1,)."""
    likelihood = np.arange(TOP + 1) / TOP
    body = (1 - rates.miss) * likelihood + rates.miss * (1 - likelihood)
    empty = rates.clutter * likelihood + (1 - rates.clutter) * (1 - likelihood)
    return np.log(body / empty).astype(np.float32)


def synergy_terms(least: float) -> Singles:
    """log L of each level, L at least `least` (L_min of METHODS 2), nats, float32 (TOP + 1,)."""
    likelihood = np.arange(TOP + 1) / TOP
    return np.log(np.maximum(likelihood, least)).astype(np.float32)


class Tally:
    """What the views said so far of each cell of a frame.

    Attributes
    ----------
    weighted, weights, count : float32 (plane, y, x)
        Sums of w_i a_i times term, of w_i a_i, and of a_i.
    """

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.weighted, self.weights = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self.count = np.zeros(shape, np.float32)

    def add(self, levels: Levels, terms: Singles, weight: float, share: Singles, faith: Singles) -> None:
        """Add one view; see `add_terms`."""
        add_terms(levels, terms, np.float32(weight), share, faith, self.weighted, self.weights, self.count)

    def total(self, views: Bytes, near: Ints, prior: float) -> Singles:
        """n_vis sum_i w_i term_i, and the prior where nobody is near, float32 (plane, y, x); see `fill_total`."""
        total = np.empty(self.weighted.shape, np.float32)
        fill_total(self.weighted, self.weights, self.count, views, near, np.float32(prior), total)
        return total


@kernel
def add_terms(
    levels: Levels,
    terms: Singles,
    weight: np.float32,
    share: Singles,
    faith: Singles,
    weighted: Singles,
    weights: Singles,
    count: Singles,
) -> None:
    """Add one view's terms to the frame's sums; see `Tally`.

    Parameters
    ----------
    levels : int16 (plane, y, x)
        Mean likelihood of each cell, or UNSEEN.
    terms : float32 (TOP + 1,)
        The term of each level, nats.
    weight
        1 / C_i, in any scale.
    share : float32 (plane, y, x)
        a_i, 0..1.
    faith : float32 (plane, y, x)
        What the term is multiplied by besides, 0..1, without being worth less of a view.
    """
    level, seen, trusted = levels.reshape(-1), share.reshape(-1), faith.reshape(-1)
    to_weighted, to_weights, to_count = weighted.reshape(-1), weights.reshape(-1), count.reshape(-1)
    for c in range(len(level)):
        if level[c] >= 0:
            part = weight * seen[c]
            to_weighted[c] += part * trusted[c] * terms[level[c]]
            to_weights[c] += part
            to_count[c] += seen[c]


@kernel
def fill_total(
    weighted: Singles,
    weights: Singles,
    count: Singles,
    views: Bytes,
    near: Ints,
    prior: np.float32,
    total: Singles,
) -> None:
    """Fill total (plane, y, x): nan where no view's image holds the cell, the prior where all are hidden.

    Parameters
    ----------
    views : uint8 (plane, y, x)
        Number of views whose image holds the cell.
    near : int64 (y, x)
        The person near each cell, -1 for nobody: pi is one half near a person, where only the cells are left to decide.
    """
    for z in range(views.shape[0]):
        for y in range(views.shape[1]):
            for x in range(views.shape[2]):
                if views[z, y, x] == 0:
                    total[z, y, x] = np.nan
                    continue
                total[z, y, x] = prior if near[y, x] < 0 else np.float32(0.0)
                if weights[z, y, x] > 0:
                    total[z, y, x] += count[z, y, x] * weighted[z, y, x] / weights[z, y, x]
