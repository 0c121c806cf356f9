"""The energy of a binary labelling of a window: unary and pairwise terms in whole quanta.

    E(l) = sum_p D_p(l_p) + sum_(p,q) B_pq [l_p != l_q],   D_p(1) - D_p(0) = -u(p)

Neighbours differ by one of a set of offsets in time, plane, y and x; in time they follow a map from ground cells to
ground cells. All capacities are whole multiples of one quantum, so that energies can be compared exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Flags, Ints, Labels

QUANTUM = 1e-3
"""Nats to one unit of capacity."""


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
