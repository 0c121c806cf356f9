"""Induced subgraph of some cells of a grid, all cells around it with label 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stseg.accelerate import kernel
from stseg.arrays import Flags, Ints, Labels
from stseg.graphcut.energy import Energy
from stseg.graphcut.lattice import Lattice, neighbour

_OUTSIDE, _FIRST = 1, 2


@dataclass(frozen=True)
class CellSubset:
    """Cells of a grid and the edges between them.

    Attributes
    ----------
    cell : int64 (n,)
        Indices in the flattened grid, ascending.
    start, end : int64 (edge,)
        Edges as indices of `cell`.
    weight : int64 (edge,)
        Capacities, quanta.
    border : int64 (n,)
        Sum of each cell's capacities to cells outside, quanta.
    """

    cell: Ints
    start: Ints
    end: Ints
    weight: Ints
    border: Ints

    def components(self) -> Ints:
        """Connected component of each cell, from 0, int64 (n,)."""
        size = len(self.cell)
        graph = csr_array((np.ones(len(self.start), bool), (self.start, self.end)), shape=(size, size))
        return np.asarray(connected_components(graph, directed=False)[1], np.int64)

    def only(self, kept: Flags) -> CellSubset:
        """Some whole components; kept bool (n,)."""
        renumbered = np.cumsum(kept) - 1
        inner = kept[self.start]
        start, end = renumbered[self.start[inner]], renumbered[self.end[inner]]
        return CellSubset(self.cell[kept], start, end, self.weight[inner], self.border[kept])


def subset(energy: Energy, inside: Flags) -> CellSubset:
    """Subgraph of the cells that are inside, bool (time, plane, y, x)."""
    cell = np.flatnonzero(inside)
    index = np.full(inside.shape, _OUTSIDE, np.int32)
    index.flat[cell] = np.arange(_FIRST, _FIRST + len(cell))
    code = energy.spread(index)
    start, end, weight = (np.empty(len(energy.offsets) * len(cell), np.int64) for _ in range(3))
    border = np.zeros(len(cell), np.int64)
    nodes = np.flatnonzero(code >= _FIRST)  # in the order of the cells
    edges = _fill_edges(nodes, code, energy.lattice, energy.capacity, start, end, weight, border)
    return CellSubset(cell, start[:edges], end[:edges], weight[:edges], border)


@kernel
def _fill_edges(
    nodes: Ints, code: Labels, lattice: Lattice, capacity: Labels, start: Ints, end: Ints, weight: Ints, border: Ints
) -> int:
    """Fill edges and border capacities; the number of edges.

    Parameters
    ----------
    nodes : int64 (n,)
        Nodes of the cells, ascending.
    code : int32 (node,)
        0 for guards, _OUTSIDE for other cells, _FIRST plus the index of a cell.
    """
    edges = 0
    for p in range(len(nodes)):
        for slot in range(2 * len(capacity)):
            q = code[neighbour(nodes[p], slot, lattice)]
            if q == _OUTSIDE:
                border[p] += capacity[slot // 2]
            elif q >= _FIRST and slot % 2 == 0:
                start[edges], end[edges], weight[edges] = p, q - _FIRST, capacity[slot // 2]
                edges += 1
    return edges
