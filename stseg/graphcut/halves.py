"""A graph solved as a whole, or its two halves at a time and then what joins them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from stseg.accelerate import part
from stseg.arrays import Flags, Labels
from stseg.graphcut.graph import Graph
from stseg.graphcut.search import NO_ARC, SOURCE, Queue, Trees, new_queue, new_trees, plant, push_near, search, wait


class Bridges(NamedTuple):
    """Arcs between the nodes below `middle` and the others; the graph holds them closed.

    Attributes
    ----------
    middle
    tail, arc, capacity : int32 (k,)
        Where each begins, and what it is to carry.
    """

    middle: int
    tail: Labels
    arc: Labels
    capacity: Labels


def solve(graph: Graph) -> Flags:
    """Nodes that the source reaches at maximum flow, bool (n,); the graph is left with that flow."""
    trees, queue = new_trees(len(graph.excess)), new_queue(len(graph.excess))
    _solve_range(graph, trees, queue, 0, len(graph.excess))
    return _reached(trees)


def solve_halves(graph: Graph, bridges: Bridges) -> Flags:
    """The same, with a thread for each half.

    No arc that can carry anything leads from one half to the other until both threads are done, so neither writes what
    the other reads. Then the bridges are opened, and the search goes on from the trees that it has.
    """
    size, middle = len(graph.excess), bridges.middle
    trees, queues = new_trees(size), (new_queue(middle), new_queue(size - middle))
    with ThreadPoolExecutor(2) as threads:
        list(threads.map(_solve_range, (graph,) * 2, (trees,) * 2, queues, (0, middle), (middle, size)))
    queue = new_queue(size)
    queue.ends[4] = max(half.ends[4] for half in queues)
    _open(graph, trees, queue, bridges.tail, bridges.arc, bridges.capacity)
    search(graph, trees, queue)
    return _reached(trees)


def _reached(trees: Trees) -> Flags:
    return np.asarray((trees.side == SOURCE) & (trees.way != NO_ARC))


@part
def _solve_range(graph: Graph, trees: Trees, queue: Queue, begin: int, end: int) -> None:
    push_near(graph, begin, end)
    plant(graph, trees, queue, begin, end)
    search(graph, trees, queue)


@part
def _open(graph: Graph, trees: Trees, queue: Queue, tails: Labels, arcs: Labels, capacities: Labels) -> None:
    """Let the bridges carry; where the source's tree stands at one, it may grow again."""
    for tail, arc, capacity in zip(tails, arcs, capacities):  # noqa: B905 - numba knows no strict
        graph.residual[arc] = capacity
        if trees.way[tail] != NO_ARC and trees.side[tail] == SOURCE:
            wait(trees, queue, tail)
