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

from stseg.accelerate import kernel, part
from stseg.arrays import Flags, Labels, Singles
from stseg.geometry.summed_area import TOP, UNSEEN, Levels


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


class FrameTerms(NamedTuple):
    """What the views of a frame add to its sums at cells (n,).

    In the blocks of cells where a view shows something its levels are given cell by cell. In all others it sees its
    empty level, and all of each footprint.

    Attributes
    ----------
    view_set : int32 (n,), block : int32 (n,)
        The set of views that see each cell, and its block.
    shown : bool (view, block)
        Whether the view's levels are given there.
    levels : int16 (view, n)
        Mean likelihood of each cell, or UNSEEN; undefined where not given.
    share : float32 (view, n)
        a_i, 0..1: visible share of the footprint; undefined where the level is, or is UNSEEN.
    seen : bool (set, view)
        The views of each set that are not blind.
    empty : int16 (view,)
        The level where nothing is shown.
    terms : float32 (view, 2, TOP + 1)
        The term of each level near no person, and within reach of a person, nats.
    weight : float32 (view,)
        1 / C_i, in any scale.
    confidence : float32 (view, person)
        Further factor of the terms near each person, 0..1, which does not reduce the view's count.
    """

    view_set: Labels
    block: Labels
    shown: Flags
    levels: Levels
    share: Singles
    seen: Flags
    empty: Levels
    terms: Singles
    weight: Singles
    confidence: Singles


class Sums(NamedTuple):
    """Sums over the views of a frame, of runs of cells that all views see alike.

    Attributes
    ----------
    start : int32 (run + 1,)
        First cell of each run, and behind the last one the number of cells.
    near : int32 (run,)
        The person near the cells of each run, -1 for none; each cell near a person is a run.
    is_empty : bool (run,)
        Whether every view sees its empty level there, and all of the footprints.
    weighted, weights, shares : float32 (run,)
        Sums of w_i a_i times term, of w_i a_i, and of a_i.
    """

    start: Labels
    near: Labels
    is_empty: Flags
    weighted: Singles
    weights: Singles
    shares: Singles

    @classmethod
    def of(cls, views: FrameTerms, near: Labels) -> Self:
        """Of all views at cells; near int32 (n,) is the person near each, -1 for none."""
        start = np.empty(len(near) + 1, np.int32)
        runs = fill_runs(views, near, start)
        start = start[: runs + 1].copy()
        sums = cls(start, near[start[:-1]], np.empty(runs, bool), *np.empty((3, runs), np.float32))
        fill_sums(views, sums)
        return sums

    def total(self, held: Flags, observations: float, priors: tuple[float, float]) -> Singles:
        """k n_vis sum_i w_i term_i and the prior of each cell, nats, float32 (n,).

        Parameters
        ----------
        held : bool (n,)
            Whether a view's image holds the cell; nan where none does. Where all are hidden it is the prior.
        observations
            k.
        priors
            log(pi / (1 - pi)) near no person, and within reach of a person.
        """
        of_run = np.empty(len(self.near), np.float32)
        fill_total(self, np.float32(observations), np.float32(priors[0]), np.float32(priors[1]), of_run)
        total = np.repeat(of_run, np.diff(self.start))
        total[~held] = np.nan
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


@part
def level_and_share(views: FrameTerms, i: int, c: int) -> tuple[int, np.float32]:
    """What view i sees of cell c; the level is UNSEEN where it does not see the cell."""
    if views.shown[i, views.block[c]]:
        return int(views.levels[i, c]), views.share[i, c]
    return int(views.empty[i]) if views.seen[views.view_set[c], i] else UNSEEN, np.float32(1)


@kernel
def fill_runs(views: FrameTerms, near: Labels, start: Labels) -> int:
    """Fill start (n + 1,) with the runs of cells of a block that all views see alike; their number."""
    shown, number, runs = np.empty(len(views.weight), np.int64), 0, 0
    for c in range(len(near)):
        if c > 0 and views.block[c] == views.block[c - 1]:
            alike = views.view_set[c] == views.view_set[c - 1] and near[c] < 0 and near[c - 1] < 0
            for k in range(number):
                alike = alike and _is_seen_alike(views, shown[k], c)
            if alike:
                continue
        else:
            number = 0
            for i in range(len(shown)):
                if views.shown[i, views.block[c]]:
                    shown[number] = i
                    number += 1
        start[runs] = c
        runs += 1
    start[runs] = len(near)
    return runs


@part
def _is_seen_alike(views: FrameTerms, i: int, c: int) -> bool:
    """Whether view i, which shows something in their block, sees cell c as it sees the one before."""
    level = views.levels[i, c]
    return bool(level == views.levels[i, c - 1] and (level < 0 or views.share[i, c] == views.share[i, c - 1]))


@kernel
def fill_sums(views: FrameTerms, sums: Sums) -> None:
    """Fill the sums of runs, whose start and persons are given."""
    for r in range(len(sums.near)):
        person, weighted, weights, shares = sums.near[r], np.float32(0), np.float32(0), np.float32(0)
        sums.is_empty[r] = person < 0
        for i in range(len(views.weight)):
            level, share = level_and_share(views, i, sums.start[r])
            if level >= 0:
                sums.is_empty[r] &= level == views.empty[i] and share == 1
                weight = views.weight[i] * share
                if person < 0:
                    weighted += weight * views.terms[i, 0, level]
                else:
                    weighted += weight * views.confidence[i, person] * views.terms[i, 1, level]
                weights += weight
                shares += share
        sums.weighted[r], sums.weights[r], sums.shares[r] = weighted, weights, shares


@kernel
def fill_total(sums: Sums, observations: np.float32, prior: np.float32, near_prior: np.float32, total: Singles) -> None:
    """Fill total (run,); see `Sums.total`."""
    for r in range(len(sums.near)):
        total[r] = prior if sums.near[r] < 0 else near_prior
        if sums.weights[r] > 0:
            total[r] += observations * sums.shares[r] * sums.weighted[r] / sums.weights[r]
