"""Alternatives to the best assignment of a frame's rows to the identities of a hypothesis: those that differ little.

Rows that certainly follow their track are never exchanged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.crossings import Crossings, crossing, crossings_with_others
from stseg.identities.search.extension import Extension
from stseg.kernels.accelerate import kernel, part


class Alternatives(NamedTuple):
    """Extended hypotheses.

    Attributes
    ----------
    change : int64 (alternative, 5)
        Hypothesis, row, its slot, other row, its slot, where they differ from the best assignment; -1 for no row, and
        for somebody new.
    value : float64 (alternative,)
        Score, nats.
    """

    change: Ints
    value: Floats


@kernel
def empty_alternatives(hypotheses: int, slots: int, doubtful: int) -> Alternatives:
    """Room for the alternatives of some hypotheses with that many slots, of that many doubtful rows."""
    most = hypotheses * (1 + doubtful * (slots + 1) + doubtful * (doubtful - 1) // 2)
    return Alternatives(np.empty((most, 5), np.int64), np.empty(most))


@part
def add_alternatives(
    h: int, one: Extension, identities: int, score: float, crossings: Crossings, most: float, number: int,
    found: Alternatives,
) -> int:  # fmt: skip
    """Add the best assignment, and those that differ from it by one exchange of two rows, or another identity of one.

    Parameters
    ----------
    h, one, identities
        The hypothesis, and the number of its identities.
    score
        Of the best assignment, nats, but for crossings.
    crossings
        What it costs that two people cross.
    most
        Greatest loss of an alternative, nats, but for crossings.
    number, found
        Alternatives so far, to which these are added.

    Returns
    -------
    int
        Number of alternatives.
    """
    cost, own, slot = one.cost, one.own, one.slot
    crossed = crossings.cost.size > 0
    if crossed:
        for i in range(len(own)):
            score -= crossings_with_others(i, own[i], -1, own, one.last, crossings) / 2.0
    _fill(found, number, h, -1, -1, -1, -1, score)
    number += 1
    for a in range(len(one.doubtful)):
        i = one.doubtful[a]
        for c in range(identities + 1 + a):  # another identity, then that of each doubtful row before
            j = one.doubtful[c - identities - 1] if c > identities else -1
            to = own[j] if j >= 0 else c
            loss = cost[i, to] - cost[i, own[i]]
            if j >= 0:
                loss = cost[i, to] + cost[j, own[i]] - cost[i, own[i]] - cost[j, to]
            if loss < most and to != own[i] and (j >= 0 or not one.taken[to]):
                if crossed:
                    loss += _crossings_of(i, to, j, own[i], own, one.last, crossings)
                    loss -= _crossings_of(i, own[i], j, to, own, one.last, crossings)
                _fill(found, number, h, i, slot[to], j, slot[own[i]], score - loss)
                number += 1
    return number


@part
def _fill(found: Alternatives, number: int, h: int, i: int, to: int, j: int, back: int, value: float) -> None:
    change = found.change
    change[number, 0], change[number, 1], change[number, 2], change[number, 3], change[number, 4] = h, i, to, j, back
    found.value[number] = value


@part
def _crossings_of(i: int, one: int, j: int, other: int, own: Ints, last: Ints, crossings: Crossings) -> float:
    """Cost of crossings of one row or two (-1 for none) as those of identities, with each other and others, nats."""
    total = crossings_with_others(i, one, j, own, last, crossings)
    if j >= 0:
        total += crossings_with_others(j, other, i, own, last, crossings)
        total += crossing(i, one, j, other, last, crossings)
    return total
