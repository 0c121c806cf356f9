"""A part of a window, everything around it background: its cells, and the edges that the energy gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stseg.accelerate import kernel
from stseg.arrays import Flags, Ints
from stseg.segmentation.energy import Energy


@dataclass(frozen=True)
class Part:
    """Some cells of a window.

    Attributes
    ----------
    cell : int64 (n,)
        Their indices in the flattened volume, rising.
    start, end : int64 (edge,)
        Pairs of neighbours among them, as indices of `cell`.
    weight : int64 (edge,)
        Their capacities, quanta.
    border : int64 (n,)
        Sum of each cell's capacities to cells that are not of the part, quanta.
    """

    cell: Ints
    start: Ints
    end: Ints
    weight: Ints
    border: Ints

    def components(self) -> Ints:
        """The connected piece that each cell belongs to, counted from 0, int64 (n,)."""
        size = len(self.cell)
        graph = csr_array((np.ones(len(self.start), bool), (self.start, self.end)), shape=(size, size))
        return np.asarray(connected_components(graph, directed=False)[1], np.int64)

    def only(self, kept: Flags) -> Part:
        """Whole connected pieces of it; kept is bool (n,)."""
        renumbered = np.cumsum(kept) - 1
        inner = kept[self.start]
        start, end = renumbered[self.start[inner]], renumbered[self.end[inner]]
        return Part(self.cell[kept], start, end, self.weight[inner], self.border[kept])


def part_of(energy: Energy, inside: Flags) -> Part:
    """The part of a window that is inside, bool (time, plane, y, x)."""
    cell = np.flatnonzero(inside)
    node = np.full(inside.shape, -1, np.int64)
    node.flat[cell] = np.arange(len(cell))
    # Every cell has one neighbour ahead in each of the four directions, so this is room for all edges.
    start, end, weight = (np.empty(4 * len(cell), np.int64) for _ in range(3))
    border = np.zeros(len(cell), np.int64)
    capacity = np.array([energy.ahead, energy.up, energy.across, energy.along])
    edges = _fill_part(node, energy.motion, capacity, start, end, weight, border)
    return Part(cell, start[:edges], end[:edges], weight[:edges], border)


@kernel
def _fill_part(node: Ints, motion: Ints, capacity: Ints, start: Ints, end: Ints, weight: Ints, border: Ints) -> int:
    """Fill the edges of a part and its border; the number of edges.

    Parameters
    ----------
    node : int64 (time, plane, y, x)
        Index of each cell in the part, -1 outside it.
    motion : int64 (time - 1, y, x, 2)
        Cells (dy, dx) moved until the next frame.
    capacity : int64 (4,)
        To the neighbour in time, between planes, in y, in x; quanta.
    """
    frames, planes, rows, columns = node.shape
    edges = 0
    for t in range(frames):
        for z in range(planes):
            for y in range(rows):
                for x in range(columns):
                    for way in range(4):
                        s, h, v, u = t, z, y, x
                        if way == 0:
                            s += 1
                        elif way == 1:
                            h += 1
                        elif way == 2:
                            v += 1
                        else:
                            u += 1
                        if way == 0 and s < frames:
                            v, u = y + motion[t, y, x, 0], x + motion[t, y, x, 1]
                        if s == frames or h == planes or v < 0 or v >= rows or u < 0 or u >= columns:
                            continue
                        p, q = node[t, z, y, x], node[s, h, v, u]
                        if p >= 0 and q >= 0:
                            start[edges], end[edges], weight[edges] = p, q, capacity[way]
                            edges += 1
                        elif p >= 0:
                            border[p] += capacity[way]
                        elif q >= 0:
                            border[q] += capacity[way]
    return edges
