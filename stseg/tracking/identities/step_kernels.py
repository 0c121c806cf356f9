"""Kernels of one frame of the identity search: costs, best assignments, alternatives, and the states after them.

Columns of an assignment are slots of identities, then one place for a new identity of each row.
"""

from __future__ import annotations

import math

import numpy as np

from stseg.accelerate import kernel, part
from stseg.arrays import Flags, Floats, Ints
from stseg.linear_assignment import fill_assignment_of_least_cost
from stseg.tracking.identities.crossings import Crossings, crossing, crossings_with_others

FORBIDDEN = 1e6
"""Cost of an assignment that is not allowed, nats."""
UNLIKELY = 200.0
"""Cost of an assignment that is demanded though the person is far away, nats."""
CONTRADICTION = 1e4
"""Cost of an assignment against a constraint, nats: taken only where constraints contradict each other."""


@part
def size_evidence(precision: float, information: float, spread: float) -> float:
    """Log-likelihood ratio of observations of one person against the population's mean, nats (Gaussian, pooled)."""
    total = 1.0 + precision * spread
    return 0.5 * (spread * information * information / total - math.log(total))


@part
def predicted_variance(covariance: Floats, seconds: float, turn: float) -> float:
    """Variance of a predicted coordinate, square metres; `turn` is the variance of velocity gained in a second."""
    still = covariance[0] + 2.0 * seconds * covariance[1] + seconds * seconds * covariance[2]
    return float(still + turn * seconds * seconds * seconds / 3.0)


@kernel
def end_identities(
    name: Ints, last: Ints, seconds: Floats, now: float, longest: float, inside: Floats, birth: float,
    awaited: Flags, score: Floats,
) -> None:  # fmt: skip
    """Free the slots of identities that were unseen for too long; each costs its death.

    Those `awaited` (hypothesis, slot) by a constraint stay.
    """
    for h in range(name.shape[0]):
        for s in range(name.shape[1]):
            if name[h, s] >= 0 and now - seconds[h, s] > longest and not awaited[h, s]:
                score[h] -= birth * inside[last[h, s]]
                name[h, s] = -1


@kernel
def fill_costs(
    name: Ints, last: Ints, seconds: Floats, state: Floats, covariance: Floats, held_precision: Floats,
    held_information: Floats, first: int, now: float, ground: Floats, variance: Floats, previous: Ints,
    certain: Flags, inside: Floats, precision: Floats, information: Floats, spread: Floats, most_against: Floats,
    turn: float, birth: float, absence: float, least: float, cost: Floats,
) -> None:  # fmt: skip
    """Fill cost (hypothesis, row, slot + row) of the rows from `first` on, nats."""
    hypotheses, slots = name.shape
    rows = cost.shape[1]
    alone, begun = np.zeros((rows, len(spread))), np.zeros(rows)
    for i in range(rows):
        for d in range(len(spread)):
            alone[i, d] = size_evidence(precision[first + i, d], information[first + i, d], spread[d])
        begun[i] = birth * inside[first + i] - alone[i].sum()
    known = np.zeros(len(spread))
    cost[:] = FORBIDDEN
    for h in range(hypotheses):
        for i in range(rows):
            cost[h, i, slots + i] = begun[i]
        for s in range(slots):
            if name[h, s] < 0:
                continue
            if h > 0 and _alike(h, s, name, last, seconds, state, covariance, held_precision, held_information):
                _take_over(cost, h, s, slots, certain[first : first + rows])
                continue
            since = now - seconds[h, s]
            x = state[h, s, 0] + since * state[h, s, 2]
            y = state[h, s, 1] + since * state[h, s, 3]
            spreads = predicted_variance(covariance[h, s], since, turn)
            measured = False
            for i in range(rows):
                r = first + i
                follows = previous[r] == last[h, s]
                if certain[r] and not follows:
                    continue
                total = spreads + variance[r]
                square = (ground[r, 0] - x) ** 2 + (ground[r, 1] - y) ** 2
                gain = max(-0.5 * square / total, least) - math.log(2.0 * math.pi * total) - absence * since
                if gain < 4.0 * least and not follows:
                    continue
                for d in range(0 if measured else len(spread)):  # few rows may be those of somebody out of sight
                    known[d] = size_evidence(held_precision[h, s, d], held_information[h, s, d], spread[d])
                measured = True
                for d in range(len(spread)):
                    if precision[r, d] == 0.0:
                        continue
                    both = held_precision[h, s, d] + precision[r, d]
                    together = size_evidence(both, held_information[h, s, d] + information[r, d], spread[d])
                    gain += max(together - known[d], alone[i, d] - most_against[d] * precision[r, d])
                cost[h, i, s] = -gain
                if certain[r]:
                    cost[h, i, slots + i] = FORBIDDEN


@part
def _alike(
    h: int, s: int, name: Ints, last: Ints, seconds: Floats, state: Floats, covariance: Floats, held_precision: Floats,
    held_information: Floats,
) -> bool:  # fmt: skip
    """Whether the hypothesis before has the same identity in the same slot, with the same past: most often it has."""
    if name[h, s] != name[h - 1, s] or last[h, s] != last[h - 1, s] or seconds[h, s] != seconds[h - 1, s]:
        return False
    for k in range(state.shape[2]):
        if state[h, s, k] != state[h - 1, s, k]:
            return False
    for k in range(covariance.shape[2]):
        if covariance[h, s, k] != covariance[h - 1, s, k]:
            return False
    for d in range(held_precision.shape[2]):
        if held_precision[h, s, d] != held_precision[h - 1, s, d]:
            return False
        if held_information[h, s, d] != held_information[h - 1, s, d]:
            return False
    return True


@part
def _take_over(cost: Floats, h: int, s: int, slots: int, certain: Flags) -> None:
    """Take the costs of a slot from the hypothesis before; who certainly is somebody is nobody new."""
    for i in range(len(certain)):
        cost[h, i, s] = cost[h - 1, i, s]
        if certain[i] and cost[h, i, s] != FORBIDDEN:
            cost[h, i, slots + i] = FORBIDDEN


@kernel
def impose_identity(name: Ints, bound: Ints, row: int, same: bool, cost: Floats) -> None:
    """Impose on the cost (hypothesis, row, slot + row) that a row is, or is not, the identity bound (hypothesis,)."""
    hypotheses, slots = name.shape
    for h in range(hypotheses):
        for s in range(slots):
            demanded = name[h, s] >= 0 and name[h, s] == bound[h]
            if demanded and same:
                own = min(cost[h, row, s], UNLIKELY)
                for c in range(cost.shape[2]):
                    cost[h, row, c] = FORBIDDEN
                cost[h, row, s] = own
                cost[h, row, slots + row] = CONTRADICTION
                break
            if demanded:
                cost[h, row, s] = FORBIDDEN
                cost[h, row, slots + row] = min(cost[h, row, slots + row], CONTRADICTION)


@kernel
def fill_best_assignments(cost: Floats, column: Ints, total: Floats) -> None:
    """Fill column (hypothesis, row) with the assignment of least cost, and total (hypothesis,) with that cost."""
    taken = np.zeros(cost.shape[2], np.bool_)
    for h in range(cost.shape[0]):
        if not _fill_cheapest(cost[h], column[h], taken):
            fill_assignment_of_least_cost(cost[h], column[h])
        total[h] = 0.0
        for i in range(cost.shape[1]):
            total[h] += cost[h, i, column[h, i]]


@part
def _fill_cheapest(cost: Floats, column: Ints, taken: Flags) -> bool:
    """Fill column (row,) with the cheapest of each row of cost (row, column); whether no other assignment is as cheap.

    It is the best one where each row has one cheapest column of its own.
    """
    taken[:] = False
    for i in range(len(column)):
        best, ties = 0, False
        for c in range(1, len(taken)):
            if cost[i, c] < cost[i, best]:
                best, ties = c, False
            elif cost[i, c] == cost[i, best]:
                ties = True
        if ties or taken[best]:
            return False
        taken[best] = True
        column[i] = best
    return True


@kernel
def fill_alternatives(
    cost: Floats, column: Ints, score: Floats, last: Ints, crossings: Crossings, most: float, change: Ints,
    value: Floats,
) -> int:  # fmt: skip
    """Fill the assignments that differ from the best by one exchange of two rows, or by another column of one row.

    Parameters
    ----------
    cost : float64 (hypothesis, row, slot + row)
    column : int64 (hypothesis, row)
        The best assignment.
    score : float64 (hypothesis,)
        Of the best assignment, nats, but for crossings.
    last : int64 (hypothesis, slot)
        Last row of each identity.
    crossings
        What it costs that two people cross.
    most
        Greatest loss of an alternative, nats, but for crossings.
    change : int64 (alternative, 5), value : float64 (alternative,)
        Filled with hypothesis, row, its column, other row (-1 for none), its column; and with the score.

    Returns
    -------
    int
        Number of alternatives.
    """
    hypotheses, rows, columns = cost.shape
    slots = last.shape[1]
    number = 0
    taken = np.zeros(columns, np.bool_)
    for h in range(hypotheses):
        best = score[h]
        for i in range(rows):
            best -= crossings_with_others(i, column[h, i], -1, column[h], last[h], crossings) / 2.0
        change[number] = h, -1, -1, -1, -1
        value[number] = best
        number += 1
        taken[:] = False
        for i in range(rows):
            taken[column[h, i]] = True
        for i in range(rows):
            own = column[h, i]
            for c in range(slots + 1):
                to = c if c < slots else slots + i
                loss = cost[h, i, to] - cost[h, i, own]
                if not taken[to] and loss < most:
                    loss += crossings_with_others(i, to, -1, column[h], last[h], crossings)
                    loss -= crossings_with_others(i, own, -1, column[h], last[h], crossings)
                    change[number] = h, i, to, -1, -1
                    value[number] = best - loss
                    number += 1
            for j in range(i):
                other = column[h, j]
                if own >= slots and other >= slots:
                    continue
                to = other if other < slots else slots + i
                back = own if own < slots else slots + j
                loss = cost[h, i, to] + cost[h, j, back] - cost[h, i, own] - cost[h, j, other]
                if loss < most:
                    loss += _crossings_of_two(i, to, j, back, column[h], last[h], crossings)
                    loss -= _crossings_of_two(i, own, j, other, column[h], last[h], crossings)
                    change[number] = h, i, to, j, back
                    value[number] = best - loss
                    number += 1
    return number


@part
def _crossings_of_two(
    i: int, slot: int, j: int, other: int, column: Ints, last: Ints, crossings: Crossings
) -> float:  # fmt: skip
    """Cost of crossings of two rows as those of two slots, with each other and with all others, nats."""
    with_others = crossings_with_others(i, slot, j, column, last, crossings)
    with_others += crossings_with_others(j, other, i, column, last, crossings)
    return with_others + crossing(i, slot, j, other, last, crossings)


_PRIMES = (2147483647, 2147483629)
"""Moduli of the two halves of a key; products of their remainders stay below 2^63."""


@part
def _cube(word: int, prime: int) -> int:
    """The cube of a whole number modulo a prime: sums of cubes tell sets of numbers apart, in any order."""
    rest = word % prime
    return rest * rest % prime * rest % prime


@part
def _kin(name: Ints, birth: Ints, own: int) -> int:
    """How an identity (its first observation) among the names of a hypothesis (slot,) is known to other hypotheses.

    By its birth, and how many of the others have the same one and began before.
    """
    rank = 0
    for other in name:
        if 0 <= other < own and birth[other] == birth[own]:
            rank += 1
    return int(birth[own] * 64 + rank)


@kernel
def choose_distinct(
    ordered: Ints, change: Ints, value: Floats, column: Ints, name: Ints, last: Ints, birth: Ints, mark: Ints,
    first: int, least: float, parent: Ints, chosen: Ints, names: Ints, score: Floats, keys: Ints,
) -> int:  # fmt: skip
    """Choose the best alternatives that differ in who is present, or in who is unseen.

    Identities of one birth are the same: hypotheses that differ in nothing but the frame of it have the same future.

    Parameters
    ----------
    ordered
        Alternatives, the best first.
    change, value
        See `fill_alternatives`.
    column, name, last
        Best assignments; names and last observations of the slots.
    birth : int64 (n,)
        Number of the birth of an identity that begins with an observation, the same for births that are one.
    mark : int64 (hypothesis,)
        Tells hypotheses apart that differ in what constraints bind.
    first
        The frame's first observation.
    least
        Least score.
    parent, score : (most,), chosen, names : (most, row)
        Filled for each choice: its hypothesis, its score, the column and the name of each row.
    keys : int64 (most,)
        Work space.

    Returns
    -------
    int
        Number of choices.
    """
    rows, slots = column.shape[1], name.shape[1]
    seen = np.zeros(slots, np.bool_)
    kin = np.empty((len(name), slots), np.int64)
    for h in range(len(name)):
        for s in range(slots):
            kin[h, s] = _kin(name[h], birth, name[h, s]) if name[h, s] >= 0 else -1
    number = 0
    for a in ordered:
        if number == len(parent) or value[a] < least:
            break
        h = change[a, 0]
        own = chosen[number]
        for i in range(rows):
            own[i] = column[h, i]
        if change[a, 1] >= 0:
            own[change[a, 1]] = change[a, 2]
        if change[a, 3] >= 0:
            own[change[a, 3]] = change[a, 4]
        seen[:] = False
        high, low = _cube(mark[h], _PRIMES[0]), _cube(mark[h], _PRIMES[1])
        for i in range(rows):
            if own[i] < slots:
                seen[own[i]] = True
                names[number, i] = name[h, own[i]]
                word = kin[h, own[i]] * 1048576 + i
            else:
                names[number, i] = first + i
                word = _kin(name[h], birth, first + i) * 1048576 + i
            high, low = (high + _cube(word, _PRIMES[0])) % _PRIMES[0], (low + _cube(word, _PRIMES[1])) % _PRIMES[1]
        for s in range(slots):
            if name[h, s] >= 0 and not seen[s]:
                word = kin[h, s] * 1048576 + rows + last[h, s]
                high, low = (high + _cube(word, _PRIMES[0])) % _PRIMES[0], (low + _cube(word, _PRIMES[1])) % _PRIMES[1]
        key = high * 2147483648 + low
        known = False
        for k in range(number):
            known = known or keys[k] == key
        if not known:
            keys[number], parent[number], score[number] = key, h, value[a]
            number += 1
    return number


@kernel
def update_identities(
    chosen: Ints, name: Ints, last: Ints, seconds: Floats, state: Floats, covariance: Floats, held_precision: Floats,
    held_information: Floats, first: int, now: float, ground: Floats, variance: Floats, precision: Floats,
    information: Floats, turn: float, pace: float,
) -> None:  # fmt: skip
    """Update the identities of each hypothesis by the rows that it assigns to them, in place.

    A new identity takes the first free slot, or that of the identity that was unseen for longest.
    """
    hypotheses, slots = name.shape
    for h in range(hypotheses):
        for i in range(chosen.shape[1]):
            r, s = first + i, chosen[h, i]
            if s < slots:
                _correct(state[h, s], covariance[h, s], now - seconds[h, s], ground[r], variance[r], turn)
            else:
                s = 0
                for other in range(slots):
                    if name[h, s] >= 0 and (name[h, other] < 0 or seconds[h, other] < seconds[h, s]):
                        s = other
                name[h, s] = r
                state[h, s] = ground[r, 0], ground[r, 1], 0.0, 0.0
                covariance[h, s] = variance[r], 0.0, pace
                held_precision[h, s], held_information[h, s] = 0.0, 0.0
            last[h, s], seconds[h, s] = r, now
            for d in range(precision.shape[1]):
                held_precision[h, s, d] += precision[r, d]
                held_information[h, s, d] += information[r, d]


@kernel
def _correct(state: Floats, covariance: Floats, since: float, ground: Floats, variance: float, turn: float) -> None:
    """Predict one filter and correct it by a place (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2)."""
    place = predicted_variance(covariance, since, turn)
    both = covariance[1] + since * covariance[2] + turn * since * since / 2.0
    pace = covariance[2] + turn * since
    total = place + variance
    for axis in range(2):
        off = ground[axis] - state[axis] - since * state[axis + 2]
        state[axis] += since * state[axis + 2] + place / total * off
        state[axis + 2] += both / total * off
    covariance[0] = place - place * place / total
    covariance[1] = both - both * place / total
    covariance[2] = pace - both * both / total
