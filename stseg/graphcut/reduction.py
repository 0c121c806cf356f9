"""Exact reduction of a binary energy: optimal labels of cells known before the cut.

First come the sets of `stseg.graphcut.sign_sets`, then persistency: with the capacities to decided neighbours
added to its unary term, a cell is decided if that outweighs its capacities to undecided neighbours, which may decide
its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Flags, Labels
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.lattice import Lattice, cells, neighbour, spread
from stseg.graphcut.sign_sets import LABEL_ONE, LABEL_ZERO, UNDECIDED
from stseg.kernels.accelerate import part

WEAK_SHARE_LIMIT = 0.9
"""Share of cells with weak unary terms from which too few could be decided to pay for the reduction."""


@dataclass(frozen=True)
class Reduction:
    """Labels known before the cut, and the problem that remains.

    Attributes
    ----------
    lattice
        Numbering of the nodes.
    capacity : int32 (degree,)
        Capacities of the arcs of a node, quanta.
    state : uint8 (node,)
        State of each node.
    left : int32 (k,)
        Undecided nodes, ascending.
    excess : int32 (k,)
        Their unary terms with the capacities to decided neighbours added, quanta.
    """

    lattice: Lattice
    capacity: Labels
    state: Bytes
    left: Labels
    excess: Labels


def reduce(energy: GridEnergy) -> Reduction:
    """Decide cells by both rules."""
    lattice, capacity, unary = energy.lattice, np.repeat(energy.capacity, 2), spread(energy.unary)
    if energy.signs.weak > WEAK_SHARE_LIMIT * energy.unary.size:
        state = energy.spread(np.full(energy.unary.shape, UNDECIDED, np.uint8))
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
) -> None:  # fmt: skip
    undecided[node] = 0
    for slot in range(len(capacity)):
        neighbour_state = state[np.uint64(neighbour(node, slot, lattice))]
        if neighbour_state == UNDECIDED:
            undecided[node] += capacity[slot]
        elif neighbour_state == LABEL_ONE:
            gain[node] += capacity[slot]
        elif neighbour_state == LABEL_ZERO:
            gain[node] -= capacity[slot]
