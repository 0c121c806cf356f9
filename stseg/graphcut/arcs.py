"""Residual graph of the undecided nodes of a reduction, stored in rows or in place.

In rows, nodes are renumbered and their neighbours stored: small graphs stay in the processor's cache. In place, nodes
keep their lattice numbers and neighbours are computed: dense grids take half the memory.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import AnyArray, Bytes, Ints, Labels
from stseg.graphcut.graph import Graph
from stseg.graphcut.lattice import Lattice, neighbour
from stseg.graphcut.parallel_max_flow import Bridges
from stseg.graphcut.reduction import Reduction
from stseg.graphcut.sign_sets import OPEN
from stseg.kernels.accelerate import part


def in_rows(reduced: Reduction, middle: int) -> tuple[Graph, Bridges]:
    """Graph of the undecided nodes, renumbered; arcs across lattice number `middle` are bridges."""
    size, degree = len(reduced.left), len(reduced.capacity)
    number = np.empty(len(reduced.state), np.int32)
    number[reduced.left] = np.arange(size, dtype=np.int32)
    head, residual = np.empty(size * degree, np.int32), np.empty(size * degree, np.int16)
    bridges = _bridge_buffer(reduced, middle, int(np.searchsorted(reduced.left, middle)))
    count = np.zeros(1, np.int64)
    _write_rows(*_open_nodes(reduced), number, middle, head, residual, *bridges[1:], count)
    graph = Graph(residual, reduced.excess.copy(), degree, None, None, head, None)
    return graph, _trimmed(bridges, int(count[0]))


def in_place(reduced: Reduction, middle: int) -> tuple[Graph, Bridges]:
    """Graph of all lattice nodes, decided ones without arcs; arcs across `middle` are bridges."""
    nodes, degree = len(reduced.state), len(reduced.capacity)
    excess, residual = np.zeros(nodes, np.int32), np.zeros(nodes * degree, np.int16)
    excess[reduced.left] = reduced.excess
    bridges = _bridge_buffer(reduced, middle, middle)
    count = np.zeros(1, np.int64)
    _write_place(*_open_nodes(reduced), middle, residual, *bridges[1:], count)
    return Graph(residual, excess, degree, None, None, None, reduced.lattice), _trimmed(bridges, int(count[0]))


def _open_nodes(reduced: Reduction) -> tuple[Labels, Bytes, Lattice, Labels]:
    return reduced.left, reduced.state, reduced.lattice, reduced.capacity


def _bridge_buffer(reduced: Reduction, middle: int, number: int) -> Bridges:
    """Buffer for the bridges: all arcs of the nodes within an edge in time of `middle`."""
    if middle == 0:
        return Bridges(number, *np.empty((3, 0), np.int32))
    lattice = reduced.lattice
    reach = lattice.frame + abs(lattice.forward).max(initial=0)
    first, last = np.searchsorted(reduced.left, (middle - reach, middle + reach))
    size = int(last - first) * len(reduced.capacity)
    return Bridges(number, *(np.empty(size, np.int32) for _ in range(3)))


def _trimmed(bridges: Bridges, number: int) -> Bridges:
    return Bridges(bridges.middle, bridges.tail[:number], bridges.arc[:number], bridges.capacity[:number])


@part
def _write_rows(
    left: Labels,
    state: Bytes,
    lattice: Lattice,
    capacity: Labels,
    number: Labels,
    middle: int,
    head: Labels,
    residual: AnyArray,
    tail: Labels,
    bridge: Labels,
    bridge_capacity: Labels,
    count: Ints,
) -> None:
    for k, node in enumerate(left):
        for slot in range(len(capacity)):
            arc = k * len(capacity) + slot
            to = neighbour(node, slot, lattice)
            head[arc], residual[arc] = k, 0
            if state[to] == OPEN:
                head[arc] = number[to]
                if (node < middle) == (to < middle):
                    residual[arc] = capacity[slot]
                else:
                    tail[count[0]], bridge[count[0]], bridge_capacity[count[0]] = k, arc, capacity[slot]
                    count[0] += 1


@part
def _write_place(
    left: Labels,
    state: Bytes,
    lattice: Lattice,
    capacity: Labels,
    middle: int,
    residual: AnyArray,
    tail: Labels,
    bridge: Labels,
    bridge_capacity: Labels,
    count: Ints,
) -> None:
    for node in left:
        for slot in range(len(capacity)):
            to = neighbour(node, slot, lattice)
            if state[to] == OPEN:
                arc = node * len(capacity) + slot
                if (node < middle) == (to < middle):
                    residual[arc] = capacity[slot]
                else:
                    tail[count[0]], bridge[count[0]], bridge_capacity[count[0]] = node, arc, capacity[slot]
                    count[0] += 1
