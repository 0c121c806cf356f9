"""Joint hypotheses of the identities of all people up to a frame, and pasts of these identities.

The past of an identity is what all its observations so far tell. Joint hypotheses agree on most of them, so each past
is kept once, and hypotheses hold numbers of pasts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.kernels.accelerate import kernel, part

FREE = -1
"""Past of a slot that holds no identity."""


class Hypotheses(NamedTuple):
    """Hypotheses, the best first; each holds identities in slots."""

    score: Floats
    """float64 (hypothesis,): nats."""
    past: Ints
    """int64 (hypothesis, slot): which of the pasts each identity has, `FREE` where there is none."""
    identity: Ints
    """int64 (hypothesis, person): identity of each person of the constraints, -1 before the first observation."""

    @classmethod
    def empty(cls, number: int, slots: int, people: int) -> Hypotheses:
        """Room for hypotheses without people."""
        return cls(np.zeros(number), np.full((number, slots), FREE), np.full((number, people), -1))

    def keep(self, chosen: Ints) -> None:
        """Move the chosen hypotheses to the front."""
        for column in self:
            column[: len(chosen)] = column[chosen]


@part
def slots_in_use(past: Ints, number: int) -> int:
    """Number of slots up to the last that holds an identity in one of some hypotheses."""
    for s in range(past.shape[1] - 1, -1, -1):
        for h in range(number):
            if past[h, s] >= 0:
                return s + 1
    return 0


@kernel
def fill_successors(
    hypotheses: Hypotheses,
    pasts: Pasts,
    size: int,
    parent: Ints,
    slot: Ints,
    slots: int,
    first: int,
    now: float,
    observed: ObservedRows,
    rules: Rules,
    successors: Hypotheses,
    later_pasts: Pasts,
) -> int:
    """Fill hypotheses with those before and a frame's rows from `first` on, and number their pasts.

    The hypotheses before have `size` pasts. `slots` is the number of slots, and `now` the frame's time; `observed` are
    all rows. `successors` and `later_pasts` are filled, but for scores.
    """
    rows, number = slot.shape[1], 0
    later, now_born = np.empty((size, rows + 1), np.int64), np.empty(rows, np.int64)
    later[:] = FREE
    now_born[:] = FREE
    for n in range(len(parent)):
        before, after = hypotheses.past[parent[n]], successors.past[n]
        after[:] = FREE
        for i in range(rows):
            s = slot[n, i]
            if s < 0:  # a new identity takes the first free slot, or that of who was unseen for longest
                s = _slot_for_new(before, after, slots, pasts.seconds, now)
                if now_born[i] < 0:
                    begin_past(later_pasts, number, first + i, now, observed, rules)
                    now_born[i], number = number, number + 1
                after[s] = now_born[i]
            elif after[s] < 0 and later[before[s], i] >= 0:
                after[s] = later[before[s], i]
            else:
                if after[s] < 0:
                    keep_past(pasts, before[s], later_pasts, number)
                    later[before[s], i] = number
                else:  # the slot was just taken: the row is that of who took it
                    keep_past(later_pasts, after[s], later_pasts, number)
                continue_past(later_pasts, number, first + i, now, observed, rules)
                after[s], number = number, number + 1
        for s in range(slots):
            if after[s] < 0 <= before[s]:
                if later[before[s], rows] < 0:
                    keep_past(pasts, before[s], later_pasts, number)
                    later[before[s], rows], number = number, number + 1
                after[s] = later[before[s], rows]
        for person in range(hypotheses.identity.shape[1]):
            successors.identity[n, person] = hypotheses.identity[parent[n], person]
    return number


@part
def _slot_for_new(before: Ints, after: Ints, slots: int, seconds: Floats, now: float) -> int:
    """The first free slot, or the one that was unseen for longest."""
    slot, earliest = 0, np.inf
    for s in range(slots):
        if before[s] < 0 and after[s] < 0:
            return s
        last = seconds[before[s]] if after[s] < 0 else now
        if last < earliest:
            slot, earliest = s, last
    return slot


class Pasts(NamedTuple):
    """Identities as different hypotheses know them."""

    name: Ints
    """int64 (past,): first observation of each identity, which is its name."""
    last: Ints
    """int64 (past,): last observation of each identity."""
    seconds: Floats
    """float64 (past,): time of the last observation."""
    state: Floats
    """float64 (past, 4): x, y, vx, vy, in metres and metres per second."""
    covariance: Floats
    """float64 (past, 3): of either axis: place, place and velocity, velocity."""
    precision: Floats
    """float64 (past, size): sums over the identity's observations."""
    information: Floats
    """float64 (past, size): sums over the identity's observations."""
    evidence: Floats
    """float64 (past, size): of these sums for one person, nats; see `size_evidence`."""

    @classmethod
    def empty(cls, number: int, sizes: int) -> Pasts:
        """Room for pasts."""
        return cls(
            np.empty(number, np.int64),
            np.empty(number, np.int64),
            np.empty(number),
            np.empty((number, 4)),
            np.empty((number, 3)),
            *(np.empty((number, sizes)) for _ in range(3)),
        )


@part
def size_evidence(precision: float, information: float, spread: float) -> float:
    """Log-likelihood ratio of observations of one person against the population's mean, nats (Gaussian, pooled)."""
    total = 1.0 + precision * spread
    return 0.5 * (spread * information * information / total - math.log(total))


@part
def predicted_variance(covariance: Floats, p: int, seconds: float, noise: float) -> float:
    """Variance of a predicted coordinate, square metres; `noise` is the process noise of `Rules`."""
    still = covariance[p, 0] + 2.0 * seconds * covariance[p, 1] + seconds * seconds * covariance[p, 2]
    return float(still + noise * seconds * seconds * seconds / 3.0)


@part
def begin_past(pasts: Pasts, p: int, r: int, now: float, observed: ObservedRows, rules: Rules) -> None:
    """Begin the p-th past with observation r."""
    pasts.name[p] = pasts.last[p] = r
    pasts.seconds[p] = now
    pasts.state[p, 0], pasts.state[p, 1] = observed.ground[r, 0], observed.ground[r, 1]
    pasts.state[p, 2] = pasts.state[p, 3] = 0.0
    pasts.covariance[p, 0], pasts.covariance[p, 1] = observed.variance[r], 0.0
    pasts.covariance[p, 2] = rules.velocity_variance
    for d in range(pasts.precision.shape[1]):
        pasts.precision[p, d], pasts.information[p, d] = observed.precision[r, d], observed.information[r, d]
        pasts.evidence[p, d] = size_evidence(observed.precision[r, d], observed.information[r, d], rules.spread[d])


@part
def keep_past(pasts: Pasts, p: int, others: Pasts, q: int) -> None:
    """Copy the p-th past to the q-th of others."""
    others.name[q], others.last[q], others.seconds[q] = pasts.name[p], pasts.last[p], pasts.seconds[p]
    for k in range(4):
        others.state[q, k] = pasts.state[p, k]
    for k in range(3):
        others.covariance[q, k] = pasts.covariance[p, k]
    for d in range(pasts.precision.shape[1]):
        others.precision[q, d], others.information[q, d] = pasts.precision[p, d], pasts.information[p, d]
        others.evidence[q, d] = pasts.evidence[p, d]


@part
def continue_past(pasts: Pasts, q: int, r: int, now: float, observed: ObservedRows, rules: Rules) -> None:
    """Continue the q-th past by observation r."""
    since = now - pasts.seconds[q]
    correct_place(pasts.state, pasts.covariance, q, since, observed.ground, observed.variance, r, rules.process_noise)
    pasts.last[q], pasts.seconds[q] = r, now
    for d in range(pasts.precision.shape[1]):
        if observed.precision[r, d] != 0.0:
            pasts.precision[q, d] += observed.precision[r, d]
            pasts.information[q, d] += observed.information[r, d]
            pasts.evidence[q, d] = size_evidence(pasts.precision[q, d], pasts.information[q, d], rules.spread[d])


@part
def correct_place(
    state: Floats, covariance: Floats, p: int, since: float, ground: Floats, variance: Floats, r: int, noise: float
) -> None:
    """Predict the p-th filter and correct it by the r-th place (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2)."""
    place = predicted_variance(covariance, p, since, noise)
    both = covariance[p, 1] + since * covariance[p, 2] + noise * since * since / 2.0
    velocity_variance = covariance[p, 2] + noise * since
    total = place + variance[r]
    for axis in range(2):
        off = ground[r, axis] - state[p, axis] - since * state[p, axis + 2]
        state[p, axis] += since * state[p, axis + 2] + place / total * off
        state[p, axis + 2] += both / total * off
    covariance[p, 0] = place - place * place / total
    covariance[p, 1] = both - both * place / total
    covariance[p, 2] = velocity_variance - both * both / total


class Rules(NamedTuple):
    """Constants of the search."""

    birth: float
    """Cost of a birth or a death inside the area, nats."""
    absence: float
    """Cost of being unseen, nats per second."""
    longest: float
    """Longest time unseen, seconds."""
    alternative_loss: float
    """Greatest loss of an alternative in one frame, nats."""
    beam_loss: float
    """Greatest loss of a hypothesis against the best, nats."""
    process_noise: float
    """Variance of the velocity gained in a second."""
    velocity_variance: float
    """Variance of the velocity of a new person."""
    spread: Floats
    """float64 (size,): variance of each size among people."""
    most_against: Floats
    """float64 (size,): greatest evidence of an appearance for a new person, nats times variance."""
