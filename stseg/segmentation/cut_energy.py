"""Binary energy of a window's occupancy volume (Khan and Shah, TPAMI 31(3), 2009, section 5).

    E(l) = sum_p D_p(l_p) + sum_(p,q) B_pq [l_p != l_q],   D_p(object) - D_p(background) = -u(p),
    B_pq = lambda exp(-dist(p, q)^2 / (2 s^2))

Neighbours differ by one of a set of offsets (time, plane, y, x). Edges in time follow the motion of the body: a person
moves several cells between frames, and an edge to the same cell would join the body to empty floor.
"""

from itertools import product

import numpy as np

from stseg.arrays import Flags, Ints, Labels, Singles
from stseg.config import SegmentationConfig
from stseg.geometry import Grid
from stseg.graphcut.grid_energy import QUANTUM, GridEnergy
from stseg.kernels.accelerate import wide_kernel

_LOG_ODDS_LIMIT = 30.0
"""Greatest magnitude of a unary term, nats."""


def build_energy(
    log_odds: Singles, successor: Labels, grid: Grid, config: SegmentationConfig, present: Flags | None = None
) -> GridEnergy:
    """Energy of a window.

    `log_odds` float32 (time, plane, y, x) are u, nats, nan where no view sees the cell: unary term 0. `successor` int32
    (time - 1, y, x) is as of `stseg.segmentation.cell_motion.successor_cells`, `present` bool (y, x), or None, as of
    `stseg.graphcut.grid_energy.GridEnergy`.
    """
    unary = np.empty(log_odds.shape, np.int32)
    fill_cut_unary(log_odds.reshape(-1), np.float32(_LOG_ODDS_LIMIT), np.float32(QUANTUM), unary.reshape(-1))
    offsets = neighbourhood(config.neighbours)
    scale = (config.time_distance, grid.top / max(grid.planes - 1, 1), grid.cell, grid.cell)
    distance = np.sqrt(((offsets * scale) ** 2).sum(1))
    capacity = config.smoothness * np.exp(-0.5 * (distance / config.distance_scale) ** 2) / QUANTUM
    return GridEnergy(unary, offsets, np.rint(capacity).astype(np.int32), successor, present)


@wide_kernel
def fill_cut_unary(log_odds: Singles, most: np.float32, quantum: np.float32, unary: Labels) -> None:
    """Fill unary (cell,), the gain of an occupied cell, -D: log-odds bounded by `most` nats, in quanta; 0 for nan."""
    for i in range(len(unary)):
        value = log_odds[i]
        value = value if value < most else most if value == value else np.float32(0)
        value = value if value > -most else -most
        unary[i] = np.int32(np.rint(value / quantum))


def neighbourhood(neighbours: int) -> Ints:
    """Half of the offsets (time, plane, y, x) to 8 neighbours, one step along one axis, or to all 80 within a step."""
    steps = [step for step in product((0, 1), (-1, 0, 1), (-1, 0, 1), (-1, 0, 1)) if step > (0, 0, 0, 0)]
    most = 1 if neighbours == 8 else 4
    return np.array([step for step in steps if sum(map(abs, step)) <= most], np.int64)
