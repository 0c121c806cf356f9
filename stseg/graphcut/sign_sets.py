"""Sets of cells of one sign that have the optimal label of their sign.

Let every cell of a set S have u <= 0 and -u at least the sum of its capacities to cells outside S. Then label 1 for any
subset of S gains nothing, so all of S has label 0 in the minimum with the smallest source set. The greatest such set is
found by removing violating cells from {u <= 0} until none is left. The mirror rule gives label 1.
"""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Bytes, Flags, Labels
from stseg.graphcut.lattice import Lattice, neighbour
from stseg.kernels.accelerate import kernel, part

GUARD, UNDECIDED, LABEL_ONE, LABEL_ZERO = 0, 1, 2, 3
"""States of a node: no cell, undecided, label 1, label 0."""


@dataclass(frozen=True)
class SignSets:
    """The greatest sets of both signs."""

    state: Bytes
    """uint8 (node,): state of each node; not to be written to."""
    weak: int
    """Number of cells with u <= 0 and a unary term below the sum of their capacities."""


def sign_sets(unary: Labels, lattice: Lattice, capacity: Labels, present: Flags | None) -> SignSets:
    """The greatest sets of an energy; unary, capacity and present as of `stseg.graphcut.grid_energy.GridEnergy`."""
    arcs, shape, nodes = np.repeat(capacity, 2), unary.shape, len(lattice.forward)
    state, margin = np.zeros(nodes, np.uint8), np.zeros(nodes, np.int32)
    present = np.ones(shape[2:], bool) if present is None else present
    weak = _fill_sets(unary, present, int(arcs.sum()), state, margin)
    _decide_sets(margin, state, lattice, arcs, np.empty(nodes, np.int32))
    return SignSets(state, weak)


@kernel
def _fill_sets(unary: Labels, present: Flags, most: int, state: Bytes, margin: Labels) -> int:
    """Fill the sets of all cells by sign, and their unary magnitudes, (node,); number of weak ones.

    Of several minima the smallest source set is wanted, so a tie decides for label 0 only.
    """
    frames, planes, rows, columns = unary.shape
    weak = 0
    for t in range(frames):
        for p in range(planes):
            for y in range(rows):
                first = ((t * (planes + 1) + p + 1) * (rows + 1) + y + 1) * (columns + 1) + 1
                gain, row = unary[t, p, y], slice(first, first + columns)
                side, slack = state[row], margin[row]
                for x in range(columns):
                    side[x] = (LABEL_ONE if gain[x] > 0 else LABEL_ZERO) if present[y, x] else GUARD
                    slack[x] = gain[x] - 1 if gain[x] > 0 else -gain[x]
                    weak += 1 if -most < gain[x] <= 0 else 0
    return weak


@part
def _decide_sets(margin: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels) -> None:
    """Start from the sets of all nodes by sign, and remove those that violate the set rule.

    `margin` is a node's unary magnitude less its capacities to nodes outside its set.
    """
    for node in range(len(state)):
        if state[node] == LABEL_ONE:
            for slot in range(len(capacity)):
                to = np.uint64(neighbour(node, slot, lattice))
                if state[to] == UNDECIDED or state[to] == LABEL_ZERO:
                    margin[node] -= capacity[slot]
                    margin[to] -= capacity[slot]
                    if state[to] == LABEL_ZERO and margin[to] < 0:
                        _remove_from_set(int(to), margin, state, lattice, capacity, stack)
    for node in range(len(state)):
        if state[node] == LABEL_ONE and margin[node] < 0:
            _remove_from_set(node, margin, state, lattice, capacity, stack)


@part
def _remove_from_set(
    node: int, margin: Labels, state: Bytes, lattice: Lattice, capacity: Labels, stack: Labels
) -> None:
    """Remove a node from its set, and all that violate the rule without it."""
    side = state[node]
    state[node] = UNDECIDED
    stack[0] = node
    top = 1
    while top > 0:
        top -= 1
        node_out = stack[top]
        for slot in range(len(capacity)):
            to = np.uint64(neighbour(node_out, slot, lattice))
            if state[to] == side:
                margin[to] -= capacity[slot]
                if margin[to] < 0:
                    state[to] = UNDECIDED
                    stack[top] = to
                    top += 1
