"""The energy of a labelling of a window's volume (METHODS 4; KS09 section 5).

    E(l) = sum_p D_p(l_p) + sum_(p,q) B_pq [l_p != l_q],   D_p(object) - D_p(background) = -u(p),
    B_pq = lambda exp(-dist(p, q)^2 / (2 s^2))

Two cells are neighbours along x, y and the planes, and in time along the motion of the body that they belong to: a
walker moves several cells between frames, and an edge straight up in time would tie them to where they no longer are.
All capacities are whole multiples of one quantum, so that energies can be compared exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints, Labels, Singles
from stseg.config import SegmentationConfig
from stseg.geometry import Grid

QUANTUM = 1e-3
"""Nats to one unit of capacity."""
_STRONGEST = 30.0


@dataclass(frozen=True)
class Energy:
    """A window's energy in quanta.

    Attributes
    ----------
    unary : int64 (time, plane, y, x)
        u in quanta: what is gained by calling the cell occupied; 0 where no view sees it.
    across, along, up, ahead
        Capacities between neighbours in y, in x, between planes, and in time.
    motion : int64 (time - 1, y, x, 2)
        Cells (dy, dx) that a body at the cell moves until the next frame.
    """

    unary: Ints
    across: int
    along: int
    up: int
    ahead: int
    motion: Ints

    def of(self, labels: Labels | Flags) -> int:
        """Energy of a labelling, relative to everything background; labels bool or 0 / 1 (time, plane, y, x)."""
        occupied = labels != 0
        total = -int(self.unary[occupied].sum())
        total += self.up * int((occupied[:, 1:] != occupied[:, :-1]).sum())
        total += self.across * int((occupied[:, :, 1:] != occupied[:, :, :-1]).sum())
        total += self.along * int((occupied[..., 1:] != occupied[..., :-1]).sum())
        start, end = time_edges(self)
        flat = occupied.reshape(-1)
        return total + self.ahead * int((flat[start] != flat[end]).sum())


def build_energy(log_odds: Singles, motion: Ints, grid: Grid, config: SegmentationConfig) -> Energy:
    """Energy of a window.

    Parameters
    ----------
    log_odds : float32 (time, plane, y, x)
        u, nats; nan where no view sees the cell, which then costs and earns nothing.
    motion : int64 (time - 1, y, x, 2)
        Cells (dy, dx) moved until the next frame.
    """

    def capacity(distance: float) -> int:
        return round(config.smoothness * float(np.exp(-0.5 * (distance / config.spread) ** 2)) / QUANTUM)

    bounded = np.nan_to_num(log_odds.astype(float), nan=0.0).clip(-_STRONGEST, _STRONGEST)
    unary = np.rint(bounded / QUANTUM).astype(np.int64)
    rise = grid.top / max(grid.planes - 1, 1)
    return Energy(unary, capacity(grid.cell), capacity(grid.cell), capacity(rise), capacity(config.step), motion)


def time_edges(energy: Energy) -> tuple[Ints, Ints]:
    """Flat indices of the two cells of each edge in time; motion that leaves the grid has no edge."""
    planes, rows, columns = energy.unary.shape[1:]
    y, x = np.arange(rows)[:, None], np.arange(columns)
    to_y, to_x = y + energy.motion[..., 0], x + energy.motion[..., 1]
    kept = (to_y >= 0) & (to_y < rows) & (to_x >= 0) & (to_x < columns)
    t, from_y, from_x = np.nonzero(kept)
    plane = np.arange(planes)[:, None]
    start = ((t * planes + plane) * rows + from_y) * columns + from_x
    end = (((t + 1) * planes + plane) * rows + to_y[kept]) * columns + to_x[kept]
    return start.ravel(), end.ravel()
