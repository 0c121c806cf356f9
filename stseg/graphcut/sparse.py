"""Minimum cut of an arbitrary graph given by its edges."""

import numpy as np

from stseg.arrays import Flags, Ints, Labels
from stseg.graphcut.max_flow import Graph, solve
from stseg.kernels.accelerate import kernel

CAPACITY_LIMIT = 1 << 29
"""Greatest sum of the capacities of one node, quanta."""


def sparse_cut(
    unary: Ints, start: Ints | Labels, end: Ints | Labels, forward: Ints | Labels, backward: Ints | Labels
) -> Flags:
    """Labelling of least energy; of several, the one with the fewest nodes of label 1.

    Parameters
    ----------
    unary : int64 (n,)
        Gain of label 1 over label 0, quanta.
    start, end : int32 or int64 (edge,)
        Ends of each edge.
    forward, backward : int64 (edge,)
        Cost of `start` 1 and `end` 0, and of the reverse; 0 or more, quanta.

    Returns
    -------
    bool (n,)
        Nodes with label 1: those that residual arcs reach from the source.

    Raises
    ------
    OverflowError
        If the capacities of a node sum to more than `CAPACITY_LIMIT`.
    """
    size, edges = len(unary), len(start)
    around = np.bincount(start, forward + backward, size) + np.bincount(end, forward + backward, size)
    if edges and around.max() > CAPACITY_LIMIT:
        raise OverflowError(f"capacities of one node sum up to {around.max():.0f} quanta, more than {CAPACITY_LIMIT}")
    # A t-link need not exceed the node's n-links.
    excess = unary.clip(-CAPACITY_LIMIT - 1, CAPACITY_LIMIT + 1).astype(np.int32)
    first = np.zeros(size + 1, np.int32)
    np.cumsum(np.bincount(start, minlength=size) + np.bincount(end, minlength=size), out=first[1:])
    head, sister, residual = (np.empty(2 * edges, np.int32) for _ in range(3))
    _list_arcs(first[:-1].copy(), start, end, forward, backward, head, sister, residual)
    return solve(Graph(residual, excess, first, sister, head))


@kernel
def _list_arcs(
    free: Labels,
    start: Ints | Labels,
    end: Ints | Labels,
    forward: Ints | Labels,
    backward: Ints | Labels,
    head: Labels,
    sister: Labels,
    residual: Labels,
) -> None:
    """Fill the arcs of all nodes; `free` is each node's next free arc."""
    for edge in range(len(start)):
        p, q = start[edge], end[edge]
        ahead = free[p]
        free[p] += 1
        back = free[q]
        free[q] += 1
        head[ahead], sister[ahead], residual[ahead] = q, back, forward[edge]
        head[back], sister[back], residual[back] = p, ahead, backward[edge]
