"""Maximum flow of a graph on one thread, or of its two halves on two threads and then of the whole."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Labels
from stseg.graphcut.graph import Graph
from stseg.graphcut.max_flow import (
    NO_ARC,
    SOURCE,
    Queue,
    Trees,
    activate,
    new_queue,
    new_trees,
    plant_roots,
    push_adjacent,
    search,
)
from stseg.kernels.accelerate import part


class Bridges(NamedTuple):
    """Arcs between the nodes below `middle` and the others; their residual capacity in the graph is 0.

    Attributes
    ----------
    middle
    tail, arc, capacity : int32 (k,)
        Node at which each begins, its index, and its capacity.
    """

    middle: int
    tail: Labels
    arc: Labels
    capacity: Labels


def solve(graph: Graph) -> Flags:
    """Nodes that residual arcs reach from the source at maximum flow, bool (n,); the graph keeps that flow."""
    trees, queue = new_trees(len(graph.excess)), new_queue(len(graph.excess))
    _solve_range(graph, trees, queue, 0, len(graph.excess))
    return _source_set(trees)


def solve_halves(graph: Graph, bridges: Bridges) -> Flags:
    """As `solve`, with one thread for each half.

    Until both threads are done no residual arc joins the halves, so neither thread writes what the other reads. Then
    the bridges get their capacities, and the search continues from its trees.
    """
    size, middle = len(graph.excess), bridges.middle
    trees, queues = new_trees(size), (new_queue(middle), new_queue(size - middle))
    with ThreadPoolExecutor(2) as threads:
        list(threads.map(_solve_range, (graph,) * 2, (trees,) * 2, queues, (0, middle), (middle, size)))
    queue = new_queue(size)
    queue.ends[4] = max(half.ends[4] for half in queues)
    _open_bridges(graph, trees, queue, bridges.tail, bridges.arc, bridges.capacity)
    search(graph, trees, queue)
    return _source_set(trees)


def _source_set(trees: Trees) -> Flags:
    return np.asarray((trees.tree == SOURCE) & (trees.parent != NO_ARC))


@part
def _solve_range(graph: Graph, trees: Trees, queue: Queue, begin: int, end: int) -> None:
    push_adjacent(graph, begin, end)
    plant_roots(graph, trees, queue, begin, end)
    search(graph, trees, queue)


@part
def _open_bridges(graph: Graph, trees: Trees, queue: Queue, tails: Labels, arcs: Labels, capacities: Labels) -> None:
    """Give the bridges their capacities; nodes of the source tree at a bridge are active again."""
    for tail, arc, capacity in zip(tails, arcs, capacities):  # noqa: B905 - numba knows no strict
        graph.residual[arc] = capacity
        if trees.parent[tail] != NO_ARC and trees.tree[tail] == SOURCE:
            activate(trees, queue, tail)
