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

from stseg.accelerate import kernel, part
from stseg.arrays import Floats, Ints

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


def crossings_of(
    before: int, first: int, stop: int, ground: Floats, variance: Floats, bend: float, room: float
) -> Crossings:
    """Crossings between the rows from `before` and those from `first` to before `stop`.

    Parameters
    ----------
    before, first, stop
        Rows.
    ground : float64 (n, 2), variance : float64 (n,)
        Places of rows in metres, and the variance of each coordinate.
    bend
        Distance of a walk from the straight path, metres (standard deviation).
    room
        Distance below which two bodies overlap, metres.
    """
    then, now = np.empty((first - before,) * 2, np.int64), np.empty((stop - first,) * 2, np.int64)
    cost = np.empty((_number_near_pairs(ground[first:stop], now), _number_near_pairs(ground[before:first], then)))
    spread = (variance[before:stop] + bend**2) / 2.0  # of one person, half from each frame
    earlier = first - before
    _fill_crossings(then, now, ground[before:first], ground[first:stop], spread[:earlier], spread[earlier:], room, cost)
    return Crossings(before, then, now, cost)


@part
def crossing(i: int, slot: int, j: int, other: int, last: Ints, crossings: Crossings) -> float:
    """Cost of rows i and j of a frame as those of two slots whose last rows are last (slot,), nats."""
    if slot >= len(last) or other >= len(last) or crossings.now[i, j] < 0:
        return 0.0
    p, q = last[slot] - crossings.before, last[other] - crossings.before
    if p < 0 or q < 0 or crossings.then[p, q] < 0:
        return 0.0
    return float(crossings.cost[crossings.now[i, j], crossings.then[p, q]])


@part
def crossings_with_others(i: int, slot: int, spared: int, column: Ints, last: Ints, crossings: Crossings) -> float:
    """Cost of row i as that of a slot, beside all rows but one and their columns (row,), nats."""
    total = 0.0
    for k in range(len(column)):
        if k not in (i, spared):
            total += crossing(i, slot, k, column[k], last, crossings)
    return total


@kernel
def _number_near_pairs(ground: Floats, pair: Ints) -> int:
    number = 0
    for i in range(len(ground)):
        for j in range(len(ground)):
            pair[i, j] = -1
            if i != j and math.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1]) < _NEAR:
                pair[i, j] = number
                number += 1
    return number


@kernel
def _fill_crossings(
    then: Ints, now: Ints, ground_then: Floats, ground: Floats, spread_then: Floats, spread: Floats, room: float,
    cost: Floats,
) -> None:  # fmt: skip
    for p, q in np.argwhere(then >= 0):
        for i, j in np.argwhere(now >= 0):
            deviation = math.sqrt(spread_then[p] + spread_then[q] + spread[i] + spread[j])
            ends, least = _approach(ground_then[p] - ground_then[q], ground[i] - ground[j])
            cost[now[i, j], then[p, q]] = math.log(_apart(ends, deviation, room) / _apart(least, deviation, room))


@part
def _approach(start: Floats, stop: Floats) -> tuple[float, float]:
    """Shorter length of two vectors, and least length on the straight path between them."""
    step_x, step_y = stop[0] - start[0], stop[1] - start[1]
    square = step_x * step_x + step_y * step_y
    share = 0.0 if square == 0.0 else min(max(-(start[0] * step_x + start[1] * step_y) / square, 0.0), 1.0)
    ends = min(math.hypot(start[0], start[1]), math.hypot(stop[0], stop[1]))
    return ends, min(math.hypot(start[0] + share * step_x, start[1] + share * step_y), ends)


@part
def _apart(distance: float, deviation: float, room: float) -> float:
    """Probability that a normal number of this mean and deviation is `room` or more away from 0."""
    scale = 1.0 / (math.sqrt(2.0) * deviation)
    return max(0.5 * math.erfc((room - distance) * scale) + 0.5 * math.erfc((room + distance) * scale), _LEAST)
