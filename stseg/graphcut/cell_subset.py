"""Induced subgraph of some cells of a grid, all cells around it with label 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Flags, Ints, Labels
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.lattice import Lattice, neighbour, nodes_of
from stseg.graphcut.qpbo import connected
from stseg.graphcut.sign_sets import GUARD
from stseg.kernels.accelerate import kernel

_OUTSIDE = -1


@dataclass(frozen=True)
class CellSubset:
    """Cells of a grid and the edges between them."""

    cell: Ints
    """int64 (n,): indices in the flattened grid, ascending."""
    start: Ints
    end: Ints
    """int64 (edge,) each: edges as indices of `cell`."""
    weight: Ints
    """int64 (edge,): capacities, quanta."""
    border: Ints
    """int64 (n,): sum of each cell's capacities to cells outside, quanta."""

    def components(self) -> Ints:
        """Connected component of each cell, from 0, int64 (n,)."""
        return connected(self.start, self.end, len(self.cell))

    def only(self, kept: Flags) -> CellSubset:
        """Some whole components; kept bool (n,)."""
        renumbered = np.cumsum(kept) - 1
        inner = kept[self.start]
        start, end = renumbered[self.start[inner]], renumbered[self.end[inner]]
        return CellSubset(self.cell[kept], start, end, self.weight[inner], self.border[kept])


def subset(energy: GridEnergy, inside: Flags) -> CellSubset:
    """Subgraph of the cells that are inside, bool (time, plane, y, x)."""
    cell = np.flatnonzero(inside)
    nodes, number = nodes_of(cell, inside.shape), np.full(len(energy.signs.state), _OUTSIDE, np.int32)
    number[nodes] = np.arange(len(cell))
    start, end, weight = (np.empty(len(energy.offsets) * len(cell), np.int64) for _ in range(3))
    border = np.zeros(len(cell), np.int64)
    edges = _fill_edges(nodes, number, energy.signs.state, energy.lattice, energy.capacity, start, end, weight, border)
    return CellSubset(cell, start[:edges], end[:edges], weight[:edges], border)


@kernel
def _fill_edges(
    nodes: Ints,
    number: Labels,
    sign: Bytes,
    lattice: Lattice,
    capacity: Labels,
    start: Ints,
    end: Ints,
    weight: Ints,
    border: Ints,
) -> int:
    """Fill edges and border capacities; the number of edges.

    Parameters
    ----------
    nodes : int64 (n,)
        Nodes of the cells, ascending.
    number : int32 (node,)
        Index of each in `nodes`; _OUTSIDE for others.
    sign : uint8 (node,)
        Of `stseg.graphcut.sign_sets`, by which guards are known.
    """
    edges = 0
    for p in range(len(nodes)):
        for slot in range(2 * len(capacity)):
            to = neighbour(nodes[p], slot, lattice)
            q = number[to]
            if q == _OUTSIDE:
                border[p] += capacity[slot // 2] if sign[to] != GUARD else 0
            elif slot % 2 == 0:
                start[edges], end[edges], weight[edges] = p, q, capacity[slot // 2]
                edges += 1
    return edges
