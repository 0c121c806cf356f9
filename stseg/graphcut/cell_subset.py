"""A part of a window, everything around it background: its cells, and the edges that the energy gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stseg.accelerate import kernel
from stseg.arrays import Flags, Ints, Labels
from stseg.graphcut.energy import Energy
from stseg.graphcut.lattice import Lattice, lay_out, neighbour, spread

_OUTSIDE, _FIRST = 1, 2


@dataclass(frozen=True)
class CellSubset:
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

    def only(self, kept: Flags) -> CellSubset:
        """Whole connected pieces of it; kept is bool (n,)."""
        renumbered = np.cumsum(kept) - 1
        inner = kept[self.start]
        start, end = renumbered[self.start[inner]], renumbered[self.end[inner]]
        return CellSubset(self.cell[kept], start, end, self.weight[inner], self.border[kept])


def subset_of(energy: Energy, inside: Flags) -> CellSubset:
    """The part of a window that is inside, bool (time, plane, y, x)."""
    cell = np.flatnonzero(inside)
    index = np.full(inside.shape, _OUTSIDE, np.int32)
    index.flat[cell] = np.arange(_FIRST, _FIRST + len(cell))
    known = spread(index)
    start, end, weight = (np.empty(len(energy.offsets) * len(cell), np.int64) for _ in range(3))
    border = np.zeros(len(cell), np.int64)
    nodes = np.flatnonzero(known >= _FIRST)  # numbered in the order of the cells
    edges = _fill_part(nodes, known, lay_out(energy), energy.capacity, start, end, weight, border)
    return CellSubset(cell, start[:edges], end[:edges], weight[:edges], border)


@kernel
def _fill_part(
    nodes: Ints, known: Labels, lattice: Lattice, capacity: Labels, start: Ints, end: Ints, weight: Ints, border: Ints
) -> int:
    """Fill the edges of a part and its border; the number of edges.

    Parameters
    ----------
    nodes : int64 (n,)
        The part's cells in the lattice, rising.
    known : int32 (node,)
        0 for guards, _OUTSIDE for cells that are not of the part, _FIRST plus the index of those that are.
    """
    edges = 0
    for p in range(len(nodes)):
        for slot in range(2 * len(capacity)):
            q = known[neighbour(nodes[p], slot, lattice)]
            if q == _OUTSIDE:
                border[p] += capacity[slot // 2]
            elif q >= _FIRST and slot % 2 == 0:
                start[edges], end[edges], weight[edges] = p, q - _FIRST, capacity[slot // 2]
                edges += 1
    return edges
