"""Pasts of identities: what is known of a person by all observations so far.

Joint hypotheses agree on most of them, so each past is kept once, and hypotheses hold numbers of pasts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.rules import Rules
from stseg.kernels.accelerate import part


class Pasts(NamedTuple):
    """Identities as different hypotheses know them.

    Attributes
    ----------
    name, last : int64 (past,)
        First and last observation of each identity; the first is its name.
    seconds : float64 (past,)
        Time of the last observation.
    state : float64 (past, 4)
        x, y, vx, vy, in metres and metres per second.
    covariance : float64 (past, 3)
        Of either axis: place, place and velocity, velocity.
    precision, information : float64 (past, size)
        Sums over the identity's observations.
    evidence : float64 (past, size)
        Of these sums for one person, nats; see `size_evidence`.
    """

    name: Ints
    last: Ints
    seconds: Floats
    state: Floats
    covariance: Floats
    precision: Floats
    information: Floats
    evidence: Floats

    @classmethod
    def empty(cls, number: int, sizes: int) -> Pasts:
        """Room for pasts."""
        return cls(
            np.empty(number, np.int64), np.empty(number, np.int64), np.empty(number), np.empty((number, 4)),
            np.empty((number, 3)), *(np.empty((number, sizes)) for _ in range(3)),
        )  # fmt: skip


@part
def size_evidence(precision: float, information: float, spread: float) -> float:
    """Log-likelihood ratio of observations of one person against the population's mean, nats (Gaussian, pooled)."""
    total = 1.0 + precision * spread
    return 0.5 * (spread * information * information / total - math.log(total))


@part
def predicted_variance(covariance: Floats, p: int, seconds: float, turn: float) -> float:
    """Variance of a predicted coordinate, square metres; `turn` is the variance of velocity gained in a second."""
    still = covariance[p, 0] + 2.0 * seconds * covariance[p, 1] + seconds * seconds * covariance[p, 2]
    return float(still + turn * seconds * seconds * seconds / 3.0)


@part
def begin_past(pasts: Pasts, p: int, r: int, now: float, seen: ObservedRows, rules: Rules) -> None:
    """Make the p-th past that of somebody whom observation r is the first of."""
    pasts.name[p] = pasts.last[p] = r
    pasts.seconds[p] = now
    pasts.state[p, 0], pasts.state[p, 1] = seen.ground[r, 0], seen.ground[r, 1]
    pasts.state[p, 2] = pasts.state[p, 3] = 0.0
    pasts.covariance[p, 0], pasts.covariance[p, 1], pasts.covariance[p, 2] = seen.variance[r], 0.0, rules.pace
    for d in range(pasts.precision.shape[1]):
        pasts.precision[p, d], pasts.information[p, d] = seen.precision[r, d], seen.information[r, d]
        pasts.evidence[p, d] = size_evidence(seen.precision[r, d], seen.information[r, d], rules.spread[d])


@part
def keep_past(pasts: Pasts, p: int, fresh: Pasts, q: int) -> None:
    """Copy the p-th past to the q-th of others."""
    fresh.name[q], fresh.last[q], fresh.seconds[q] = pasts.name[p], pasts.last[p], pasts.seconds[p]
    for k in range(4):
        fresh.state[q, k] = pasts.state[p, k]
    for k in range(3):
        fresh.covariance[q, k] = pasts.covariance[p, k]
    for d in range(pasts.precision.shape[1]):
        fresh.precision[q, d], fresh.information[q, d] = pasts.precision[p, d], pasts.information[p, d]
        fresh.evidence[q, d] = pasts.evidence[p, d]


@part
def continue_past(pasts: Pasts, q: int, r: int, now: float, seen: ObservedRows, rules: Rules) -> None:
    """Continue the q-th past by observation r."""
    correct_place(pasts.state, pasts.covariance, q, now - pasts.seconds[q], seen.ground, seen.variance, r, rules.turn)
    pasts.last[q], pasts.seconds[q] = r, now
    for d in range(pasts.precision.shape[1]):
        if seen.precision[r, d] != 0.0:
            pasts.precision[q, d] += seen.precision[r, d]
            pasts.information[q, d] += seen.information[r, d]
            pasts.evidence[q, d] = size_evidence(pasts.precision[q, d], pasts.information[q, d], rules.spread[d])


@part
def correct_place(
    state: Floats, covariance: Floats, p: int, since: float, ground: Floats, variance: Floats, r: int, turn: float
) -> None:
    """Predict the p-th filter and correct it by the r-th place (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2)."""
    place = predicted_variance(covariance, p, since, turn)
    both = covariance[p, 1] + since * covariance[p, 2] + turn * since * since / 2.0
    pace = covariance[p, 2] + turn * since
    total = place + variance[r]
    for axis in range(2):
        off = ground[r, axis] - state[p, axis] - since * state[p, axis + 2]
        state[p, axis] += since * state[p, axis + 2] + place / total * off
        state[p, axis + 2] += both / total * off
    covariance[p, 0] = place - place * place / total
    covariance[p, 1] = both - both * place / total
    covariance[p, 2] = pace - both * both / total
