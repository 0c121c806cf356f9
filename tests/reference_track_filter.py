"""Whom a frame expects, by definition: slow, plain, one person at a time, without the fast code's ideas."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Flags, Floats


def normal(off: float, variance: float) -> float:
    """Log-density of a normal distribution, nats."""
    return -0.5 * off**2 / variance - 0.5 * math.log(2 * math.pi * variance)


def normal_place(off: Floats, covariance: Floats) -> float:
    """Log-density of a normal distribution on the ground, nats."""
    (xx, xy), (_, yy) = covariance
    area = xx * yy - xy * xy
    square = (yy * off[0] ** 2 - 2 * xy * off[0] * off[1] + xx * off[1] ** 2) / area
    return float(-0.5 * square - math.log(2 * math.pi) - 0.5 * math.log(area))


def best_pairs(gain: Floats) -> list[tuple[int, int]]:
    """Pairs of row and column, one to one, of the greatest sum; none that gains nothing."""
    rows, columns = linear_sum_assignment(np.minimum(-gain, 0.0))
    return [(j, k) for j, k in zip(rows.tolist(), columns.tolist(), strict=True) if gain[j, k] > 0]


def most_of_pairs(gain: Floats, row: int = 0, free: frozenset[int] | None = None) -> float:
    """The most that any pairs, one to one, gain; by trying all."""
    if row == len(gain):
        return 0.0
    columns = frozenset(range(gain.shape[1])) if free is None else free
    tried = [float(gain[row, k]) + most_of_pairs(gain, row + 1, columns - {k}) for k in columns]
    return max([most_of_pairs(gain, row + 1, columns), *tried])


def _around(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """Cells of a plane and of a frame one cell wide around it."""
    for v, u in np.ndindex(shape[0] + 2, shape[1] + 2):
        yield v - 1, u - 1


def away_from_border(open_to_people: Flags, cell: float) -> Floats:
    """Distance of each cell's centre to the nearest centre outside, less half a cell; metres, 0 outside."""
    inside = {(int(v), int(u)) for v, u in zip(*np.nonzero(open_to_people), strict=True)}
    outside = [place for place in _around(open_to_people.shape) if place not in inside]
    away = np.zeros(open_to_people.shape)
    for place in inside:
        away[place] = (min(math.dist(place, other) for other in outside) - 0.5) * cell
    return away


def kalman(state: Floats, covariance: Floats, place: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """The textbook's correction of x, y, vx, vy by a measured place."""
    look = np.eye(2, 4)
    gain = covariance @ look.T @ np.linalg.inv(look @ covariance @ look.T + noise)
    return state + gain @ (place - look @ state), (np.eye(4) - gain @ look) @ covariance
