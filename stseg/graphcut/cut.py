"""Exact minimum cut of the binary energy of a space-time grid; many cells are decided before the cut.

First come the sets of `stseg.graphcut.sign_sets`, then persistency: with the capacities to decided neighbours
added to its unary term, a cell is decided if that outweighs its capacities to undecided neighbours, which may decide
its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Flags, Labels
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.lattice import Lattice, cells, neighbour, node_values
from stseg.graphcut.max_flow import Graph, solve
from stseg.graphcut.sign_sets import LABEL_ONE, LABEL_ZERO, UNDECIDED
from stseg.kernels.accelerate import kernel, part

GREATEST_CAPACITY = 16383
"""Quanta: the sums of all capacities of a node stay far below what 32 bits hold."""


@dataclass(frozen=True)
class Cut:
    """A minimum cut."""

    occupied: Flags
    """bool (time, plane, y, x): cells with label 1."""
    nodes: int
    """Number of cells that the reduction left undecided."""


def minimum_cut(energy: GridEnergy) -> Cut:
    """Labelling of least energy; of several, the one with the fewest cells of label 1.

    Parameters
    ----------
    energy
        Capacities of at most 16383 quanta each, and at most 2**30 together.

    Raises
    ------
    OverflowError
        If a capacity is too large.
    """
    if energy.capacity.max(initial=0) > GREATEST_CAPACITY:
        raise OverflowError(f"a capacity of {energy.capacity.max()} quanta, more than {GREATEST_CAPACITY}")
    reduced = reduce(energy)
    if len(reduced.left):
        reduced.state[reduced.left[solve(_residual_graph(reduced))]] = LABEL_ONE
    return Cut(np.asarray(cells(reduced.state, energy.unary.shape) == LABEL_ONE), len(reduced.left))


def _residual_graph(reduced: Reduction) -> Graph:
    """Graph of the undecided nodes, renumbered; arcs off the graph have capacity 0 and end at their own node."""
    size, degree = len(reduced.left), len(reduced.capacity)
    number = np.empty(len(reduced.state), np.int32)
    number[reduced.left] = np.arange(size, dtype=np.int32)
    head, sister, residual = np.empty((3, size * degree), np.int32)
    first = np.arange(size + 1, dtype=np.int32) * np.int32(degree)
    _fill_arcs(reduced.left, reduced.state, reduced.lattice, reduced.capacity, number, head, sister, residual)
    return Graph(residual, reduced.excess.copy(), first, sister, head)


@kernel
def _fill_arcs(
    left: Labels,
    state: Bytes,
    lattice: Lattice,
    capacity: Labels,
    number: Labels,
    head: Labels,
    sister: Labels,
    residual: Labels,
) -> None:
    """Fill head, sister and residual of the arcs of the undecided nodes; slots 2 i and 2 i + 1 are opposite."""
    degree = len(capacity)
    for k, node in enumerate(left):
        for slot in range(degree):
            arc, to = k * degree + slot, neighbour(node, slot, lattice)
            head[arc], sister[arc], residual[arc] = k, arc, 0
            if state[to] == UNDECIDED:
                head[arc], sister[arc] = number[to], number[to] * degree + (slot ^ 1)
                residual[arc] = capacity[slot]


WEAK_SHARE_LIMIT = 0.9
"""Share of cells with weak unary terms from which too few could be decided to pay for the reduction."""


@dataclass(frozen=True)
class Reduction:
    """Labels known before the cut, and the problem that remains."""

    lattice: Lattice
    """Numbering of the nodes."""
    capacity: Labels
    """int32 (degree,): capacities of the arcs of a node, quanta."""
    state: Bytes
    """uint8 (node,): state of each node."""
    left: Labels
    """int32 (k,): undecided nodes, ascending."""
    excess: Labels
    """int32 (k,): their unary terms with the capacities to decided neighbours added, quanta."""


def reduce(energy: GridEnergy) -> Reduction:
    """Decide cells by both rules."""
    lattice, capacity, unary = energy.lattice, np.repeat(energy.capacity, 2), node_values(energy.unary)
    if energy.signs.weak > WEAK_SHARE_LIMIT * energy.unary.size:
        state = energy.node_values(np.full(energy.unary.shape, UNDECIDED, np.uint8))
        left = np.flatnonzero(state).astype(np.int32)
        return Reduction(lattice, capacity, state, left, unary[left])
    state = energy.signs.state.copy()
    stack, undecided = (np.empty(len(state), np.int32) for _ in range(2))
    left = np.flatnonzero(state == UNDECIDED).astype(np.int32)
    _decide_nodes(left, unary, undecided, state, lattice, capacity, stack)
    left = left[state[left] == UNDECIDED]
    return Reduction(lattice, capacity, state, left, unary[left])


def greatest_empty_set(energy: GridEnergy) -> Flags:
    """The cells that the set rule gives label 0, bool (time, plane, y, x)."""
    return np.asarray(cells(energy.signs.state, energy.unary.shape) == LABEL_ZERO)


@part
def _decide_nodes(
    left: Labels, gain: Labels, undecided: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels
) -> None:
    """Decide nodes by persistency, with a work list.

    `gain` becomes a node's unary term with its capacities to decided nodes, `undecided` the sum of those to others.
    """
    for node in left:
        _sum_neighbours(node, gain, undecided, state, lattice, capacity)
    for first in left:
        if state[first] != UNDECIDED or not _is_decided(first, gain, undecided):
            continue
        state[first] = LABEL_ONE if gain[first] > 0 else LABEL_ZERO
        stack[0] = first
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            for slot in range(len(capacity)):
                to = np.uint64(neighbour(node, slot, lattice))
                if state[to] == UNDECIDED:
                    undecided[to] -= capacity[slot]
                    gain[to] += capacity[slot] if state[node] == LABEL_ONE else -capacity[slot]
                    if _is_decided(int(to), gain, undecided):
                        state[to] = LABEL_ONE if gain[to] > 0 else LABEL_ZERO
                        stack[top] = to
                        top += 1


@part
def _is_decided(node: int, gain: Labels, undecided: Labels) -> bool:
    return bool(gain[node] > undecided[node] or -gain[node] >= undecided[node])


@part
def _sum_neighbours(
    node: int, gain: Labels, undecided: Labels, state: Bytes, lattice: Lattice, capacity: Labels
) -> None:
    undecided[node] = 0
    for slot in range(len(capacity)):
        neighbour_state = state[np.uint64(neighbour(node, slot, lattice))]
        if neighbour_state == UNDECIDED:
            undecided[node] += capacity[slot]
        elif neighbour_state == LABEL_ONE:
            gain[node] += capacity[slot]
        elif neighbour_state == LABEL_ZERO:
            gain[node] -= capacity[slot]
