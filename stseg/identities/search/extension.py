"""Extension of one joint hypothesis by the rows of a frame: their costs, the best assignment, and its alternatives.

A row is assigned to one of the hypothesis's identities, which are numbered in the order of their slots, or to a new
one, which has the number after all of these. Alternatives differ little from the best assignment; rows that certainly
follow their track are never exchanged.
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.constraints import NamedPeople, is_awaited
from stseg.identities.search.costs import CONTRADICTION, FORBIDDEN, UNLIKELY, RowCosts
from stseg.identities.search.hypotheses import FREE, Hypotheses, Pasts, Rules
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.linear_assignment import fill_assignment_of_least_cost


class Extension(NamedTuple):
    """The identities of a hypothesis, and the rows of a frame."""

    slot: Ints
    """int64 (identity + 1,): slot of each; -1 for a new one."""
    name: Ints
    """int64 (identity + 1,): first row of each; -1 for a new one."""
    cost: Floats
    """float64 (row, identity + 1): nats."""
    assigned: Ints
    """int64 (row,): the best assignment."""
    has_row: Flags
    """bool (identity + 1,): whether a row has each identity by the best assignment; never of a new one."""
    doubtful: Ints
    """int64 (k,): rows that do not certainly follow their track, rising; all others have the identity that they follow,
    or a new one where there is none, and no other cost is known of them."""


@kernel
def empty_extension(most: int, first: int, rows: int, certain: Flags) -> Extension:
    """Room for an extension of at most so many identities by rows from `first` on; certain (n,) is of all rows."""
    doubtful, number = np.empty(rows, np.int64), 0
    for i in range(rows):
        if not certain[first + i]:
            doubtful[number] = i
            number += 1
    return Extension(
        np.empty(most + 1, np.int64),
        np.empty(most + 1, np.int64),
        np.empty((rows, most + 1)),
        np.empty(rows, np.int64),
        np.empty(most + 1, np.bool_),
        doubtful[:number],
    )


@part
def end_identities(
    hypotheses: Hypotheses,
    pasts: Pasts,
    h: int,
    first: int,
    now: float,
    observed: ObservedRows,
    people: NamedPeople,
    rules: Rules,
) -> None:
    """Free the slots of identities that were unseen for too long; each costs its death. Those awaited stay."""
    for s in range(hypotheses.past.shape[1]):
        p = hypotheses.past[h, s]
        is_over = p >= 0 and now - pasts.seconds[p] > rules.longest
        if is_over and not is_awaited(people, hypotheses.identity, h, pasts.name[p], first):
            hypotheses.score[h] -= rules.birth * observed.inside[pasts.last[p]]
            hypotheses.past[h, s] = FREE


@part
def fill_identities(hypotheses: Hypotheses, pasts: Pasts, h: int, costs: RowCosts, one: Extension) -> int:
    """Fill the identities of a hypothesis, their costs, and the rows that certainly follow; number of identities."""
    number, assigned, doubtful = 0, one.assigned, one.doubtful
    for i in range(len(assigned)):
        assigned[i] = FREE
    for s in range(hypotheses.past.shape[1]):
        p = hypotheses.past[h, s]
        if p >= 0:
            one.slot[number], one.name[number] = s, pasts.name[p]
            one.has_row[number] = costs.follower[p] >= 0
            if costs.follower[p] >= 0:
                assigned[costs.follower[p]] = number
                one.cost[costs.follower[p], number] = costs.cost[p, costs.follower[p]]
            for i in doubtful:
                one.cost[i, number] = costs.cost[p, i]
            number += 1
    one.slot[number] = one.name[number] = -1
    one.has_row[number] = False
    for i in range(len(assigned)):
        one.cost[i, number] = costs.begun[i]
        if assigned[i] < 0:
            assigned[i] = number
    return number


@part
def impose_identity(one: Extension, identities: int, name: int, row: int, same: bool) -> None:
    """Impose on the costs that a row is, or is not, the identity of this name."""
    cost = one.cost
    for c in range(identities):
        if one.name[c] == name:
            if same:
                demanded = min(cost[row, c], UNLIKELY)
                for other in range(identities):
                    cost[row, other] = FORBIDDEN
                cost[row, c], cost[row, identities] = demanded, CONTRADICTION
                break
            cost[row, c] = FORBIDDEN
            cost[row, identities] = min(cost[row, identities], CONTRADICTION)


@part
def fill_cheapest_identities(one: Extension, identities: int) -> bool:
    """Fill the cheapest identity of each doubtful row; whether no other assignment is as cheap.

    It is the best one where each row has one cheapest identity of its own.
    """
    cost, has_row = one.cost, one.has_row
    for i in one.doubtful:
        best, ties = 0, False
        for c in range(1, identities + 1):
            if cost[i, c] < cost[i, best]:
                best, ties = c, False
            elif cost[i, c] == cost[i, best]:
                ties = True
        if ties or has_row[best]:
            return False
        has_row[best] = best < identities
        one.assigned[i] = best
    return True


@kernel
def fill_least(one: Extension, identities: int, slots: int) -> None:
    """Fill the assignment of least cost, found in a table of all slots and a new identity for each row."""
    rows = len(one.assigned)
    table, column = np.empty((rows, slots + rows)), np.empty(rows, np.int64)
    number, certain = np.empty(slots + rows, np.int64), np.empty(rows, np.bool_)
    table[:] = FORBIDDEN
    number[:] = identities
    certain[:] = True
    for c in range(identities):
        number[one.slot[c]] = c
        one.has_row[c] = False
    for i in one.doubtful:
        certain[i] = False
        for c in range(identities):
            table[i, one.slot[c]] = one.cost[i, c]
        table[i, slots + i] = one.cost[i, identities]
    for i in range(rows):
        if certain[i]:
            c = one.assigned[i]
            table[i, one.slot[c] if c < identities else slots + i] = one.cost[i, c]
    fill_assignment_of_least_cost(table, column)
    for i in range(rows):
        one.assigned[i] = number[column[i]]
        one.has_row[one.assigned[i]] = one.assigned[i] < identities


class Alternatives(NamedTuple):
    """Extended hypotheses."""

    change: Ints
    """int64 (alternative, 5): hypothesis, row, its slot, other row, its slot, where they differ from the best
    assignment; -1 for no row, and for a new person."""
    value: Floats
    """float64 (alternative,): score, nats."""


@kernel
def empty_alternatives(hypotheses: int, slots: int, doubtful: int) -> Alternatives:
    """Room for the alternatives of some hypotheses with that many slots, of that many doubtful rows."""
    most = hypotheses * (1 + doubtful * (slots + 1) + doubtful * (doubtful - 1) // 2)
    return Alternatives(np.empty((most, 5), np.int64), np.empty(most))


@part
def add_alternatives(
    h: int, one: Extension, identities: int, score: float, most: float, number: int, found: Alternatives
) -> int:
    """Add the best assignment, and those that differ from it by one exchange of two rows, or another identity of one.

    Hypothesis `h` has so many identities, and its best assignment a score, nats. `most` is the greatest loss of an
    alternative, nats. Returned is the number of alternatives in `found`, which were `number` before.
    """
    cost, assigned, slot = one.cost, one.assigned, one.slot
    _fill(found, number, h, -1, -1, -1, -1, score)
    number += 1
    for a in range(len(one.doubtful)):
        i = one.doubtful[a]
        for c in range(identities + 1 + a):  # another identity, then that of each doubtful row before
            j = one.doubtful[c - identities - 1] if c > identities else -1
            to = assigned[j] if j >= 0 else c
            loss = cost[i, to] - cost[i, assigned[i]]
            if j >= 0:
                loss = cost[i, to] + cost[j, assigned[i]] - cost[i, assigned[i]] - cost[j, to]
            if loss < most and to != assigned[i] and (j >= 0 or not one.has_row[to]):
                _fill(found, number, h, i, slot[to], j, slot[assigned[i]], score - loss)
                number += 1
    return number


@part
def _fill(found: Alternatives, number: int, h: int, i: int, to: int, j: int, back: int, value: float) -> None:
    change = found.change
    change[number, 0], change[number, 1], change[number, 2], change[number, 3], change[number, 4] = h, i, to, j, back
    found.value[number] = value
