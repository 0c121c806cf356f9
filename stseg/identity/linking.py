"""Who of one frame is whom of the next: one-to-one assignments of places within a walker's reach."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Floats, Ints
from stseg.config import IdentityConfig

_STEADY = 0.8
"""How much of the last step is expected again."""


def assign(cost: Floats, most: Floats | float) -> tuple[Ints, Ints]:
    """Pairs of least total cost, as many as have a cost of at most `most`; rows and columns, both int64."""
    if not cost.size:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    allowed = cost <= most
    worst = float(cost[allowed].max(initial=0.0)) + 1.0
    rows, columns = linear_sum_assignment(np.where(allowed, cost - worst * min(cost.shape), 0.0))
    kept = allowed[rows, columns]
    return rows[kept], columns[kept]


def distances(a: Floats, b: Floats) -> Floats:
    """Distances of every point (n, 2) from every other (m, 2), metres, float64 (n, m)."""
    return np.asarray(np.hypot(*np.moveaxis(a[:, None] - b[None], -1, 0)))


class Linker:
    """Links each frame's people to those of the frame before, following their motion."""

    def __init__(self, frame_rate: float, config: IdentityConfig) -> None:
        self.reach = config.walking_speed / frame_rate + config.slack
        self.ground = np.zeros((0, 2))
        self.step = np.zeros((0, 2))

    def link(self, ground: Floats) -> Ints:
        """For each person of the next frame (n, 2) the index in the frame before, int64 (n,); -1 for nobody."""
        before = np.full(len(ground), -1, np.int64)
        expected = self.ground + _STEADY * self.step
        cost = distances(expected, ground)
        cost[distances(self.ground, ground) > self.reach] = np.inf
        rows, columns = assign(cost, self.reach)
        before[columns] = rows
        step = np.zeros((len(ground), 2))
        step[columns] = ground[columns] - self.ground[rows]
        self.ground, self.step = ground.copy(), step
        return before
