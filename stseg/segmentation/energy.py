"""The energy of a labelling of a window's volume (METHODS 4; KS09 section 5).

    E(l) = sum_p D_p(l_p) + sum_(p,q) B_pq [l_p != l_q],   D_p(object) - D_p(background) = -u(p),
    B_pq = lambda exp(-dist(p, q)^2 / (2 s^2))

Neighbours differ by one of a set of offsets in time, plane, y and x. In time they follow the motion of the body that
they belong to: a walker moves several cells between frames, and an edge straight up in time would tie them to where
they no longer are. All capacities are whole multiples of one quantum, so that energies can be compared exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from stseg.arrays import AnyArray, Flags, Ints, Labels, Singles
from stseg.config import SegmentationConfig
from stseg.geometry import Grid
from stseg.segmentation.motion import follow

QUANTUM = 1e-3
"""Nats to one unit of capacity."""
_STRONGEST = 30.0


@dataclass(frozen=True)
class Energy:
    """A window's energy in quanta.

    Attributes
    ----------
    unary : int32 (time, plane, y, x)
        u in quanta: what is gained by calling the cell occupied; 0 where no view sees it.
    offsets : int64 (k, 4)
        Half of the neighbourhood, an offset (time, plane, y, x) of each opposite pair: within a frame, then ahead.
    capacity : int32 (k,)
        What is paid for neighbours at each offset that differ.
    ahead : int32 (time - 1, y, x)
        The ground cell, y columns + x, where a body at the cell is in the next frame; -1 where no edge leads on. No
        two cells lead to the same.
    """

    unary: Labels
    offsets: Ints
    capacity: Labels
    ahead: Labels

    def of(self, labels: Labels | Flags) -> int:
        """Energy of a labelling, relative to everything background; labels bool or 0 / 1 (time, plane, y, x)."""
        occupied = labels != 0
        total = -int(self.unary[occupied].sum(dtype=np.int64))
        for (start, end), capacity in zip(self.ends(occupied), self.capacity.tolist(), strict=True):
            total += capacity * int(np.count_nonzero(start != end))
        return total

    def ends(self, volume: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
        """Values of a volume (time, plane, y, x) at both ends of all edges, offset by offset."""
        for time, plane, y, x in self.offsets.tolist():
            start, end = _apart((plane, y, x))
            if time == 0:
                yield volume[:, *start], volume[:, *end]
            else:
                below, above = volume[:-1, start[0]], volume[1:, end[0]]
                to = _beside(self.ahead, y, x)
                frames, rows, columns = np.nonzero(to >= 0)
                flat = above.reshape(*above.shape[:2], to.shape[1] * to.shape[2])
                yield below[frames, :, rows, columns], flat[frames, :, to[frames, rows, columns]]

    def edges(self) -> tuple[Ints, Ints, Ints]:
        """All edges: flat indices of their cells, int64 (edge,), and their capacities."""
        index = np.arange(self.unary.size).reshape(self.unary.shape)
        starts, ends = zip(*((start.ravel(), end.ravel()) for start, end in self.ends(index)), strict=True)
        capacity = np.repeat(self.capacity.astype(np.int64), [len(start) for start in starts])
        return np.concatenate(starts), np.concatenate(ends), capacity


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


def _apart(offset: tuple[int, ...]) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """The parts of a frame in which the first and the second of two cells at an offset can be."""
    start = tuple(slice(max(-step, 0), -step if step > 0 else None) for step in offset)
    end = tuple(slice(max(step, 0), step if step < 0 else None) for step in offset)
    return start, end


def _beside(ahead: Labels, y: int, x: int) -> Labels:
    """The ground cells that lie so far from those that `ahead` leads to; -1 where there are none."""
    rows, columns = ahead.shape[1:]
    to_y, to_x = ahead // columns + y, ahead % columns + x
    kept = (ahead >= 0) & (to_y >= 0) & (to_y < rows) & (to_x >= 0) & (to_x < columns)
    return np.where(kept, to_y * columns + to_x, -1)
