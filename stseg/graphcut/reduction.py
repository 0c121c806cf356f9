"""Cells whose label is certain before any cut.

First by sets. Let every cell of a set S have u <= 0 and lose at least as much, -u, as all its capacities to cells
outside S together. Then nothing is won by calling any part of S occupied, so all of S is background in the minimum with
the smallest object set. The greatest such set is what remains of all cells with u <= 0 once those that do not hold are
taken out one after the other. Its mirror image, the greatest set of cells with more than they could pay, is occupied.

Then one by one (persistency): with the capacities to decided neighbours counted in, a cell that outweighs its
capacities to those undecided is decided itself, which may decide its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.accelerate import part
from stseg.arrays import Bytes, Labels
from stseg.graphcut.energy import Energy
from stseg.graphcut.lattice import Lattice, lay_out, neighbour, spread

GUARD, OPEN, OCCUPIED, EMPTY = 0, 1, 2, 3
"""What is known of a node."""
HOPELESS = 0.9
"""Share of cells weaker than their capacities together from which too few are decided to be worth looking for."""


@dataclass(frozen=True)
class Reduction:
    """What is left to cut.

    Attributes
    ----------
    lattice
        How nodes are numbered.
    capacity : int32 (degree,)
        What the arcs of a node carry.
    state : uint8 (node,)
        What is known of each node.
    left : int32 (k,)
        Nodes that are still to be decided, in rising order.
    excess : int32 (k,)
        Their unary with the capacities to decided neighbours added, quanta.
    """

    lattice: Lattice
    capacity: Labels
    state: Bytes
    left: Labels
    excess: Labels


def reduce(energy: Energy) -> Reduction:
    """Decide what can be decided without a cut."""
    lattice, capacity = lay_out(energy), np.repeat(energy.capacity, 2)
    unary = spread(energy.unary)
    weak = np.count_nonzero((energy.unary <= 0) & (energy.unary > -capacity.sum()))
    if weak > HOPELESS * energy.unary.size:
        state = spread(np.full(energy.unary.shape, OPEN, np.uint8))
        left = np.flatnonzero(state).astype(np.int32)
        return Reduction(lattice, capacity, state, left, unary[left])
    state = spread(np.where(energy.unary > 0, np.uint8(OCCUPIED), np.uint8(EMPTY)))
    stack, doubt = (np.empty(len(state), np.int32) for _ in range(2))
    # Of several minima the smallest object set is wanted, so a tie holds for the background only.
    margin = np.where(unary > 0, unary - 1, -unary)
    _decide_sets(margin, state, lattice, capacity, stack)
    left = np.flatnonzero(state == OPEN).astype(np.int32)
    _decide_single(left, unary, doubt, state, lattice, capacity, stack)
    left = left[state[left] == OPEN]
    return Reduction(lattice, capacity, state, left, unary[left])


@part
def _decide_sets(margin: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels) -> None:
    """From all nodes as their signs have them, open those that do not hold.

    `margin` is what a node has left when it has paid its capacities to those that are not of its set.
    """
    for node in range(len(state)):
        if state[node] == OCCUPIED:
            for slot in range(len(capacity)):
                to = neighbour(node, slot, lattice)
                if state[to] == OPEN or state[to] == EMPTY:
                    margin[node] -= capacity[slot]
                    margin[to] -= capacity[slot]
                    if state[to] == EMPTY and margin[to] < 0:
                        _open(to, margin, state, lattice, capacity, stack)
    for node in range(len(state)):
        if state[node] == OCCUPIED and margin[node] < 0:
            _open(node, margin, state, lattice, capacity, stack)


@part
def _open(node: int, margin: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels) -> None:
    """Take a node out of its set, and all that no longer hold without it."""
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
def _decide_single(
    left: Labels, gain: Labels, doubt: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels
) -> None:
    """Decide open nodes that outweigh what is open around them, and so on from each of them.

    `gain` becomes a node's unary with its capacities to decided nodes, `doubt` is the sum of those to open ones.
    """
    for node in left:
        _look_around(node, gain, doubt, state, lattice, capacity)
    for first in left:
        if state[first] != OPEN or not _outweighs(first, gain, doubt):
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
                    doubt[to] -= capacity[slot]
                    gain[to] += capacity[slot] if state[node] == OCCUPIED else -capacity[slot]
                    if _outweighs(to, gain, doubt):
                        state[to] = OCCUPIED if gain[to] > 0 else EMPTY
                        stack[top] = to
                        top += 1


@part
def _outweighs(node: int, gain: Labels, doubt: Labels) -> bool:
    return bool(gain[node] > doubt[node] or -gain[node] >= doubt[node])


@part
def _look_around(
    node: int, gain: Labels, doubt: Labels, state: Bytes, lattice: Lattice, capacity: Labels
) -> None:  # fmt: skip
    doubt[node] = 0
    for slot in range(len(capacity)):
        there = state[neighbour(node, slot, lattice)]
        if there == OPEN:
            doubt[node] += capacity[slot]
        elif there == OCCUPIED:
            gain[node] += capacity[slot]
        elif there == EMPTY:
            gain[node] -= capacity[slot]
