"""The energy of a labelling of a window's volume (METHODS 4; KS09 section 5).

    E(l) = sum_p D_p(l_p) + sum_(p,q) B_pq [l_p != l_q],   D_p(object) - D_p(background) = -u(p),
    B_pq = lambda exp(-dist(p, q)^2 / (2 s^2))

Neighbours differ by one of a set of offsets in time, plane, y and x. In time they follow the motion of the body that
they belong to: a walker moves several cells between frames, and an edge straight up in time would tie them to where
they no longer are. All capacities are whole multiples of one quantum, so that energies can be compared exactly.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from stseg.arrays import Ints, Singles
from stseg.config import SegmentationConfig
from stseg.geometry import Grid
from stseg.graphcut.energy import QUANTUM, Energy
from stseg.segmentation.motion import follow

_STRONGEST = 30.0


def build_energy(log_odds: Singles, motion: Ints, grid: Grid, config: SegmentationConfig) -> Energy:
    """Energy of a window.

    Parameters
    ----------
    log_odds : float32 (time, plane, y, x)
        u, nats; nan where no view sees the cell, which then costs and earns nothing.
    motion : int64 (time - 1, y, x, 2)
        Cells (dy, dx) moved until the next frame.
    """
    bounded = np.nan_to_num(log_odds, nan=0.0).clip(-_STRONGEST, _STRONGEST)
    unary = np.rint(bounded / np.float32(QUANTUM)).astype(np.int32)
    offsets = neighbourhood(config.neighbours)
    scale = (config.step, grid.top / max(grid.planes - 1, 1), grid.cell, grid.cell)
    distance = np.sqrt(((offsets * scale) ** 2).sum(1))
    capacity = config.smoothness * np.exp(-0.5 * (distance / config.spread) ** 2) / QUANTUM
    return Energy(unary, offsets, np.rint(capacity).astype(np.int32), follow(motion))


def neighbourhood(neighbours: int) -> Ints:
    """Half of the offsets (time, plane, y, x) to 8 neighbours, one step along one axis, or to all 80 within a step."""
    steps = [step for step in product((0, 1), (-1, 0, 1), (-1, 0, 1), (-1, 0, 1)) if step > (0, 0, 0, 0)]
    most = 1 if neighbours == 8 else 4
    return np.array([step for step in steps if sum(map(abs, step)) <= most], np.int64)
