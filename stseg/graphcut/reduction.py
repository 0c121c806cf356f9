"""Exact reduction of a binary energy: cells whose optimal label is known before the cut.

Sets: let every cell of a set S have u <= 0 and -u at least the sum of its capacities to cells outside S. Then label 1
for any subset of S gains nothing, so all of S has label 0 in the minimum with the smallest source set. The greatest
such set is found by removing violating cells from {u <= 0} until none is left. The mirror rule gives label 1.

Persistency: with the capacities to decided neighbours added to its unary term, a cell whose unary term outweighs its
capacities to undecided neighbours is decided, which may decide its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.accelerate import kernel, part
from stseg.arrays import Bytes, Flags, Labels
from stseg.graphcut.energy import Energy
from stseg.graphcut.lattice import Lattice, cells, neighbour, spread

GUARD, OPEN, OCCUPIED, EMPTY = 0, 1, 2, 3
"""States of a node: no cell, undecided, label 1, label 0."""
HOPELESS = 0.9
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


def reduce(energy: Energy) -> Reduction:
    """Decide cells by both rules."""
    lattice, capacity = energy.lattice, np.repeat(energy.capacity, 2)
    unary = spread(energy.unary)
    state, margin = np.zeros(len(unary), np.uint8), np.zeros_like(unary)
    shape = energy.unary.shape
    weak = _fill_sets(energy.unary, int(capacity.sum()), cells(state, shape), cells(margin, shape))
    _leave_out_absent(energy, state)
    if weak > HOPELESS * energy.unary.size:
        state = energy.spread(np.full(energy.unary.shape, OPEN, np.uint8))
        left = np.flatnonzero(state).astype(np.int32)
        return Reduction(lattice, capacity, state, left, unary[left])
    stack, undecided = (np.empty(len(state), np.int32) for _ in range(2))
    _decide_sets(margin, state, lattice, capacity, stack)
    left = np.flatnonzero(state == OPEN).astype(np.int32)
    _decide_nodes(left, unary, undecided, state, lattice, capacity, stack)
    left = left[state[left] == OPEN]
    return Reduction(lattice, capacity, state, left, unary[left])


def greatest_empty_set(energy: Energy) -> Flags:
    """The cells that the set rule gives label 0, bool (time, plane, y, x)."""
    lattice, capacity, shape = energy.lattice, np.repeat(energy.capacity, 2), energy.unary.shape
    nodes = len(lattice.forward)
    state, margin = np.zeros(nodes, np.uint8), np.zeros(nodes, np.int32)
    _fill_sets(energy.unary, 0, cells(state, shape), cells(margin, shape))
    _leave_out_absent(energy, state)
    _decide_sets(margin, state, lattice, capacity, np.empty(nodes, np.int32))
    return np.asarray(cells(state, shape) == EMPTY)


def _leave_out_absent(energy: Energy, state: Bytes) -> None:
    """Make guards of the nodes where there is no cell."""
    if energy.present is not None:
        cells(state, energy.unary.shape)[..., ~energy.present] = GUARD


@kernel
def _fill_sets(unary: Labels, most: int, state: Bytes, margin: Labels) -> int:
    """Fill the sets of all cells by sign, and their unary magnitudes, (time, plane, y, x); number of weak ones.

    Of several minima the smallest source set is wanted, so a tie decides for label 0 only.
    """
    frames, planes, rows, columns = unary.shape
    weak = 0
    for t in range(frames):
        for p in range(planes):
            for y in range(rows):
                for x in range(columns):
                    gain = unary[t, p, y, x]
                    state[t, p, y, x] = OCCUPIED if gain > 0 else EMPTY
                    margin[t, p, y, x] = gain - 1 if gain > 0 else -gain
                    weak += 1 if -most < gain <= 0 else 0
    return weak


@part
def _decide_sets(margin: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels) -> None:
    """Start from the sets of all nodes by sign, and remove those that violate the set rule.

    `margin` is a node's unary magnitude less its capacities to nodes outside its set.
    """
    for node in range(len(state)):
        if state[node] == OCCUPIED:
            for slot in range(len(capacity)):
                to = neighbour(node, slot, lattice)
                if state[to] == OPEN or state[to] == EMPTY:
                    margin[node] -= capacity[slot]
                    margin[to] -= capacity[slot]
                    if state[to] == EMPTY and margin[to] < 0:
                        _remove_from_set(to, margin, state, lattice, capacity, stack)
    for node in range(len(state)):
        if state[node] == OCCUPIED and margin[node] < 0:
            _remove_from_set(node, margin, state, lattice, capacity, stack)


@part
def _remove_from_set(
    node: int, margin: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels
) -> None:
    """Remove a node from its set, and all that violate the rule without it."""
    side = state[node]
    state[node] = OPEN
    stack[0] = node
    top = 1
    while top > 0:
        top -= 1
        taken = stack[top]
        for slot in range(len(capacity)):
            to = neighbour(taken, slot, lattice)
            if state[to] == side:
                margin[to] -= capacity[slot]
                if margin[to] < 0:
                    state[to] = OPEN
                    stack[top] = to
                    top += 1


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
        if state[first] != OPEN or not _is_decided(first, gain, undecided):
            continue
        state[first] = OCCUPIED if gain[first] > 0 else EMPTY
        stack[0] = first
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            for slot in range(len(capacity)):
                to = neighbour(node, slot, lattice)
                if state[to] == OPEN:
                    undecided[to] -= capacity[slot]
                    gain[to] += capacity[slot] if state[node] == OCCUPIED else -capacity[slot]
                    if _is_decided(to, gain, undecided):
                        state[to] = OCCUPIED if gain[to] > 0 else EMPTY
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
        there = state[neighbour(node, slot, lattice)]
        if there == OPEN:
            undecided[node] += capacity[slot]
        elif there == OCCUPIED:
            gain[node] += capacity[slot]
        elif there == EMPTY:
            gain[node] -= capacity[slot]
