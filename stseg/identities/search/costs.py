"""Costs of the rows of a frame as those of identities or of new people, and of two people who cross.

Bodies do not pass through each other. Two people at a distance r in one frame and r' in the next one walk from r
to r' between them. Where that path comes nearer than both of its ends, they have to pass each other there:

    cost = log P(apart | d_ends) - log P(apart | d_least),   P(apart | d) = P(|n| >= room), n ~ N(d, v)

with d_ends the shorter one of r and r', d_least the distance of the path, and `room` the distance below which two
bodies overlap. v is the variance of r and of the distance of the walk from the straight path: a walk that sets out at
an angle, and arrives nevertheless, is off by a quarter of speed times time half way. Their distance in the frames
themselves counts with the places.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.identities.evidence.observations import ObservedRows
from stseg.identities.search.hypotheses import Pasts, Rules, predicted_variance, size_evidence
from stseg.kernels.accelerate import kernel, part

FORBIDDEN = 1e6
"""Cost of an assignment that is not allowed, nats."""
UNLIKELY = 200.0
"""Cost of an assignment that is demanded though the person is far away, nats."""
CONTRADICTION = 1e4
"""Cost of an assignment against a constraint, nats: taken only where constraints contradict each other."""


class RowCosts(NamedTuple):
    """Costs of the rows of a frame, nats."""

    cost: Floats
    """float64 (past, row): as those of each past."""
    follower: Ints
    """int64 (past,): the row that certainly follows each, -1 for none."""
    begun: Floats
    """float64 (row,): as a new person."""


@kernel
def row_costs(
    pasts: Pasts, size: int, first: int, rows: int, now: float, observed: ObservedRows, rules: Rules
) -> RowCosts:  # fmt: skip
    """Costs of the rows of a frame, which begin with `first`, as those of some pasts."""
    sizes = len(rules.spread)
    costs = RowCosts(np.empty((size, rows)), np.empty(size, np.int64), np.empty(rows))
    costs.cost[:] = FORBIDDEN
    costs.follower[:] = -1
    alone = np.empty((rows, sizes))
    for i in range(rows):
        r, evidence = first + i, 0.0
        for d in range(sizes):
            alone[i, d] = size_evidence(observed.precision[r, d], observed.information[r, d], rules.spread[d])
            evidence += alone[i, d]
        costs.begun[i] = rules.birth * observed.inside[r] - evidence
    for p in range(size):
        _fill_costs(pasts, p, first, now, observed, rules, alone, costs)
    return costs


@part
def _fill_costs(
    pasts: Pasts, p: int, first: int, now: float, observed: ObservedRows, rules: Rules, alone: Floats,
    costs: RowCosts,
) -> None:  # fmt: skip
    """Fill the costs of rows as those of the p-th past; `alone` (row, size) is the size evidence of new people."""
    since = now - pasts.seconds[p]
    x = pasts.state[p, 0] + since * pasts.state[p, 2]
    y = pasts.state[p, 1] + since * pasts.state[p, 3]
    spreads = predicted_variance(pasts.covariance, p, since, rules.turn)
    for i in range(len(alone)):
        r = first + i
        follows = observed.previous[r] == pasts.last[p]
        if observed.certain[r] and not follows:
            continue
        total = spreads + observed.variance[r]
        square = (observed.ground[r, 0] - x) ** 2 + (observed.ground[r, 1] - y) ** 2
        gain = max(-0.5 * square / total, rules.least) - math.log(2.0 * math.pi * total) - rules.absence * since
        if gain < 4.0 * rules.least and not follows:
            continue
        for d in range(alone.shape[1]):
            if observed.precision[r, d] == 0.0:
                continue
            both = pasts.precision[p, d] + observed.precision[r, d]
            together = size_evidence(both, pasts.information[p, d] + observed.information[r, d], rules.spread[d])
            gain += max(together - pasts.evidence[p, d], alone[i, d] - rules.most_against[d] * observed.precision[r, d])
        costs.cost[p, i] = -gain
        if observed.certain[r]:
            costs.follower[p] = i


_CROSSING_DISTANCE = 1.0
"""Distance in both frames below which two may have crossed, metres."""
_LEAST_PROBABILITY = 1e-10
"""Least probability that two are apart: what is known of places is bounded."""


class Crossings(NamedTuple):
    """Costs of a frame, by pairs of near rows."""

    before: int
    """First row of the frame before."""
    then: Ints
    """int64 (row before, row before): number of each ordered pair of near rows."""
    now: Ints
    """int64 (row, row): -1 for those that are apart."""
    cost: Floats
    """float64 (pair now, pair before): nats."""


@kernel
def crossings_of(
    before: int, first: int, stop: int, ground: Floats, variance: Floats, bend_square: float, room: float
) -> Crossings:
    """Crossings between the rows from `before` and those from `first` to before `stop`.

    `ground` float64 (n, 2) are places of rows in metres, `variance` float64 (n,) that of each coordinate. `bend_square`
    is the square of the distance of a walk from the straight path (variance), square metres, and `room` the distance
    below which two bodies overlap, metres.
    """
    then, now = np.empty((first - before, first - before), np.int64), np.empty((stop - first, stop - first), np.int64)
    cost = np.empty((_number_near_pairs(ground, first, now), _number_near_pairs(ground, before, then)))
    if cost.size:
        _fill_crossings(then, now, ground, variance, before, first, bend_square, room, cost)
    return Crossings(before, then, now, cost)


@part
def crossing(i: int, one: int, j: int, other: int, last: Ints, crossings: Crossings) -> float:
    """Cost of rows i and j of a frame as those of two identities with their last rows, last (identity,), nats."""
    if crossings.now[i, j] < 0:
        return 0.0
    p, q = last[one] - crossings.before, last[other] - crossings.before
    if p < 0 or q < 0 or crossings.then[p, q] < 0:
        return 0.0
    return float(crossings.cost[crossings.now[i, j], crossings.then[p, q]])


@part
def crossings_with_others(i: int, one: int, spared: int, assigned: Ints, last: Ints, crossings: Crossings) -> float:
    """Cost of row i as that of an identity, beside all rows but one and their identities (row,), nats."""
    total = 0.0
    for k in range(len(assigned)):
        if k not in (i, spared):
            total += crossing(i, one, k, assigned[k], last, crossings)
    return total


@part
def _number_near_pairs(ground: Floats, first: int, pair: Ints) -> int:
    """Number the ordered pairs of near rows from `first` on, pair (row, row); how many there are."""
    number = 0
    for i in range(len(pair)):
        for j in range(len(pair)):
            pair[i, j] = -1
            if i != j:
                x, y = ground[first + i, 0] - ground[first + j, 0], ground[first + i, 1] - ground[first + j, 1]
                if math.hypot(x, y) < _CROSSING_DISTANCE:
                    pair[i, j] = number
                    number += 1
    return number


@part
def _fill_crossings(
    then: Ints, now: Ints, ground: Floats, variance: Floats, before: int, first: int, bend_square: float, room: float,
    cost: Floats,
) -> None:  # fmt: skip
    for p in range(before, first):
        for q in range(before, first):
            if then[p - before, q - before] >= 0:
                pair, spread = then[p - before, q - before], _spread(variance, p, q, 0.0, bend_square)
                x, y = ground[p, 0] - ground[q, 0], ground[p, 1] - ground[q, 1]
                for i in range(first, first + len(now)):
                    for j in range(first, first + len(now)):
                        if now[i - first, j - first] >= 0:
                            deviation = math.sqrt(_spread(variance, i, j, spread, bend_square))
                            later_x, later_y = ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1]
                            ends, least = _approach(x, y, later_x, later_y)
                            ratio = _apart(ends, deviation, room) / _apart(least, deviation, room)
                            cost[now[i - first, j - first], pair] = math.log(ratio)


@part
def _spread(variance: Floats, one: int, other: int, before: float, bend_square: float) -> float:
    """Variance of two people in one of both frames, added to that before: half of each person's from each frame."""
    return float(before + (variance[one] + bend_square) / 2.0 + (variance[other] + bend_square) / 2.0)


@part
def _approach(x: float, y: float, later_x: float, later_y: float) -> tuple[float, float]:
    """Shorter length of two vectors, and least length on the straight path between them."""
    step_x, step_y = later_x - x, later_y - y
    square = step_x * step_x + step_y * step_y
    share = 0.0 if square == 0.0 else min(max(-(x * step_x + y * step_y) / square, 0.0), 1.0)
    ends = min(math.hypot(x, y), math.hypot(later_x, later_y))
    return ends, min(math.hypot(x + share * step_x, y + share * step_y), ends)


@part
def _apart(distance: float, deviation: float, room: float) -> float:
    """Probability that a normal number of this mean and deviation is `room` or more away from 0."""
    scale = 1.0 / (math.sqrt(2.0) * deviation)
    probability = 0.5 * math.erfc((room - distance) * scale) + 0.5 * math.erfc((room + distance) * scale)
    return max(probability, _LEAST_PROBABILITY)
