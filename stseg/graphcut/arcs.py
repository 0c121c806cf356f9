"""The graph of what a reduction leaves, stored in one of two ways.

In rows, nodes are numbered anew and their neighbours written down: small graphs stay in the processor's cache. In
place, nodes keep their numbers in the window and neighbours are computed: of a dense window it takes half the memory.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import part
from stseg.arrays import AnyArray, Bytes, Ints, Labels
from stseg.graphcut.graph import Graph
from stseg.graphcut.halves import Bridges
from stseg.graphcut.lattice import Lattice, neighbour
from stseg.graphcut.reduction import OPEN, Reduction


def in_rows(reduced: Reduction, middle: int) -> tuple[Graph, Bridges]:
    """Graph of the open nodes, numbered as they follow each other; arcs across `middle` are bridges."""
    size, degree = len(reduced.left), len(reduced.capacity)
    number = np.empty(len(reduced.state), np.int32)
    number[reduced.left] = np.arange(size, dtype=np.int32)
    head, residual = np.empty(size * degree, np.int32), np.empty(size * degree, np.int16)
    bridges = _no_bridges(reduced, middle, int(np.searchsorted(reduced.left, middle)))
    built = np.zeros(1, np.int64)
    _write_rows(*_window(reduced), number, middle, head, residual, *bridges[1:], built)
    graph = Graph(residual, reduced.excess.copy(), degree, None, None, head, None)
    return graph, _built(bridges, int(built[0]))


def in_place(reduced: Reduction, middle: int) -> tuple[Graph, Bridges]:
    """Graph of all nodes, in which decided ones have no arcs; arcs across `middle` are bridges."""
    nodes, degree = len(reduced.state), len(reduced.capacity)
    excess, residual = np.zeros(nodes, np.int32), np.zeros(nodes * degree, np.int16)
    excess[reduced.left] = reduced.excess
    bridges = _no_bridges(reduced, middle, middle)
    built = np.zeros(1, np.int64)
    _write_place(*_window(reduced), middle, residual, *bridges[1:], built)
    return Graph(residual, excess, degree, None, None, None, reduced.lattice), _built(bridges, int(built[0]))


def _window(reduced: Reduction) -> tuple[Labels, Bytes, Lattice, Labels]:
    return reduced.left, reduced.state, reduced.lattice, reduced.capacity


def _no_bridges(reduced: Reduction, middle: int, number: int) -> Bridges:
    """Room for the bridges: all arcs of the nodes that are at most a frame and its guards away."""
    lattice = reduced.lattice
    reach = lattice.frame + abs(lattice.ahead).max(initial=0)
    first, last = np.searchsorted(reduced.left, (middle - reach, middle + reach))
    room = int(last - first) * len(reduced.capacity) if middle > 0 else 0
    return Bridges(number, *(np.empty(room, np.int32) for _ in range(3)))


def _built(bridges: Bridges, number: int) -> Bridges:
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
    carries: Labels,
    built: Ints,
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
                    tail[built[0]], bridge[built[0]], carries[built[0]] = k, arc, capacity[slot]
                    built[0] += 1


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
    carries: Labels,
    built: Ints,
) -> None:
    for node in left:
        for slot in range(len(capacity)):
            to = neighbour(node, slot, lattice)
            if state[to] == OPEN:
                arc = node * len(capacity) + slot
                if (node < middle) == (to < middle):
                    residual[arc] = capacity[slot]
                else:
                    tail[built[0]], bridge[built[0]], carries[built[0]] = node, arc, capacity[slot]
                    built[0] += 1
