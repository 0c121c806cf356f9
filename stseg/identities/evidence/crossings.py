"""Bodies do not pass through each other: what it costs that two people cross between two frames.

Two people whose positions differ by r in one frame and by r' in the next one walk from r to r' between them. Where that
path comes nearer than both of its ends, they have to pass each other there:

    cost = log P(apart | d_ends) - log P(apart | d_least),   P(apart | d) = P(|n| >= room), n ~ N(d, v)

with d_ends the shorter one of r and r', d_least the distance of the path, and `room` the distance below which two
bodies overlap. v is the variance of r and of how far the walk leaves the straight path: somebody who sets out at an
angle, and arrives nevertheless, is off by a quarter of speed times time half way. How near they stand in the frames
themselves was decided with the places.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel, part

_NEAR = 1.0
"""Distance in both frames below which two may have crossed, metres."""
_LEAST = 1e-10
"""Least probability that two are apart: what is known of places is bounded."""


class Crossings(NamedTuple):
    """Costs of a frame, by pairs of near rows.

    Attributes
    ----------
    before
        First row of the frame before.
    then : int64 (row before, row before), now : int64 (row, row)
        Number of each ordered pair of near rows, -1 for those that are apart.
    cost : float64 (pair now, pair before)
        Nats.
    """

    before: int
    then: Ints
    now: Ints
    cost: Floats


@kernel
def crossings_of(
    before: int, first: int, stop: int, ground: Floats, variance: Floats, bend_square: float, room: float
) -> Crossings:
    """Crossings between the rows from `before` and those from `first` to before `stop`.

    Parameters
    ----------
    before, first, stop
        Rows.
    ground : float64 (n, 2), variance : float64 (n,)
        Places of rows in metres, and the variance of each coordinate.
    bend_square
        Square of the distance of a walk from the straight path (variance), square metres.
    room
        Distance below which two bodies overlap, metres.
    """
    then, now = np.empty((first - before, first - before), np.int64), np.empty((stop - first, stop - first), np.int64)
    cost = np.empty((_number_near_pairs(ground, first, now), _number_near_pairs(ground, before, then)))
    if cost.size:
        _fill_crossings(then, now, ground, variance, before, first, bend_square, room, cost)
    return Crossings(before, then, now, cost)


@part
def crossing(i: int, one: int, j: int, other: int, last: Ints, crossings: Crossings) -> float:
    """Cost of rows i and j of a frame as those of two identities whose last rows are last (identity,), nats."""
    if crossings.now[i, j] < 0:
        return 0.0
    p, q = last[one] - crossings.before, last[other] - crossings.before
    if p < 0 or q < 0 or crossings.then[p, q] < 0:
        return 0.0
    return float(crossings.cost[crossings.now[i, j], crossings.then[p, q]])


@part
def crossings_with_others(i: int, one: int, spared: int, own: Ints, last: Ints, crossings: Crossings) -> float:
    """Cost of row i as that of an identity, beside all rows but one and their identities (row,), nats."""
    total = 0.0
    for k in range(len(own)):
        if k not in (i, spared):
            total += crossing(i, one, k, own[k], last, crossings)
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
                if math.hypot(x, y) < _NEAR:
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
    return max(0.5 * math.erfc((room - distance) * scale) + 0.5 * math.erfc((room + distance) * scale), _LEAST)
