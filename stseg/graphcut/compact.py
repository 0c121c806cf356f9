"""Minimum cut of any graph of nodes and edges; of several minima, the one with the smallest object set."""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Ints, Labels
from stseg.graphcut.graph import Graph
from stseg.graphcut.halves import solve

MOST = 1 << 29
"""What the capacities of one node may sum up to, quanta."""


def least_cut(
    unary: Ints, start: Ints | Labels, end: Ints | Labels, forward: Ints | Labels, backward: Ints | Labels
) -> Flags:
    """The labelling of least energy.

    Parameters
    ----------
    unary : int64 (n,)
        What is gained by calling each node occupied, quanta.
    start, end : int32 or int64 (edge,)
        Nodes that each edge joins.
    forward, backward : int64 (edge,)
        What is paid where `start` is occupied and `end` is not, and the other way round; 0 or more, quanta.

    Returns
    -------
    bool (n,)
        True where a node is occupied: those that the source can still reach.

    Raises
    ------
    OverflowError
        If the capacities of a node sum up to more than `MOST`.
    """
    size, edges = len(unary), len(start)
    around = np.bincount(start, forward + backward, size) + np.bincount(end, forward + backward, size)
    if edges and around.max() > MOST:
        raise OverflowError(f"capacities of one node sum up to {around.max():.0f} quanta, more than {MOST}")
    # More than its capacities can carry away, a node's own gain need not be.
    excess = unary.clip(-MOST - 1, MOST + 1).astype(np.int32)
    first = np.zeros(size + 1, np.int32)
    np.cumsum(np.bincount(start, minlength=size) + np.bincount(end, minlength=size), out=first[1:])
    head, sister, residual = (np.empty(2 * edges, np.int32) for _ in range(3))
    _list_arcs(first[:-1].copy(), start, end, forward, backward, head, sister, residual)
    return solve(Graph(residual, excess, 0, first, sister, head, None))


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
    """Fill the arcs of all nodes; `free` is the next free arc of each."""
    for edge in range(len(start)):
        p, q = start[edge], end[edge]
        there = free[p]
        free[p] += 1
        back = free[q]
        free[q] += 1
        head[there], sister[there], residual[there] = q, back, forward[edge]
        head[back], sister[back], residual[back] = p, there, backward[edge]
