"""Maximum flow by two search trees (Boykov and Kolmogorov 2004).

One search tree grows from the source, one from the sink. Where they touch, an augmenting path is saturated; nodes
that it cuts from their terminal are orphans, which find a new parent or become free.

The source stands for label 1: the t-link of a node with `excess` > 0 carries that much from the source, that of a node
with `excess` < 0 that much to the sink. When no node is active, the source tree holds every node that residual arcs
reach from the source: of all minimum cuts, the one with the smallest source set.
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Flags, Ints, Labels
from stseg.kernels.accelerate import kernel, part

NO_ARC, TERMINAL, ORPHAN = -1, -2, -3
"""Codes in place of the arc to the parent: free node; root; orphan."""
SOURCE, SINK = 0, 1
_UNBOUNDED = 1 << 30
"""More than any capacity, quanta, and any path length, arcs."""


class Graph(NamedTuple):
    """A residual graph."""

    residual: Labels
    """int32 (arc,): residual capacities (n-links); the arcs of a node are consecutive."""
    excess: Labels
    """int32 (n,): residual capacity of each t-link: from the source (> 0) or to the sink (< 0)."""
    first: Labels
    """int32 (n + 1,): first arc of each node."""
    sister: Labels
    head: Labels
    """int32 (arc,) each: reverse arc of each arc, and the node at its end."""


class Trees(NamedTuple):
    """The two search trees."""

    parent: Labels
    """int32 (n,): arc to the parent, or one of the codes above."""
    tree: Bytes
    """uint8 (n,): tree of a node that is not free: SOURCE or SINK."""
    timestamp: Labels
    distance: Labels
    """int32 (n,) each: arcs between a node and its terminal, and the time at which they were counted."""
    active: Bytes
    """uint8 (n,): whether the node is in the queue of active nodes."""


class Queue(NamedTuple):
    """Ring buffers of the active nodes and of the orphans."""

    active_nodes: Labels
    orphans: Labels
    """int32 (n + 1,) each."""
    ends: Ints
    """int64 (5,): first and past the last active node; the same of the orphans; the time."""


def solve(graph: Graph) -> Flags:
    """Nodes that residual arcs reach from the source at maximum flow, bool (n,); the graph keeps that flow."""
    nodes = len(graph.excess)
    parent, timestamp, distance = (np.zeros(nodes, np.int32) for _ in range(3))
    trees = Trees(parent, np.zeros(nodes, np.uint8), timestamp, distance, np.zeros(nodes, np.uint8))
    queue = Queue(np.empty(nodes + 1, np.int32), np.empty(nodes + 1, np.int32), np.zeros(5, np.int64))
    _solve(graph, trees, queue)
    return np.asarray((trees.tree == SOURCE) & (trees.parent != NO_ARC))


@kernel
def _solve(graph: Graph, trees: Trees, queue: Queue) -> None:
    _push_adjacent(graph)
    _plant_roots(graph, trees, queue)
    _search(graph, trees, queue)


# Before the search


@part
def _push_adjacent(graph: Graph) -> None:
    """Saturate the paths source, node, neighbour, sink, in one sweep.

    Most of the maximum flow takes such paths, and the sweep is faster than the search.
    """
    residual, excess = graph.residual, graph.excess
    for node in range(len(excess)):
        left = excess[node]
        if left <= 0:
            continue
        for arc in range(graph.first[node], graph.first[node + 1]):
            free_capacity = np.int32(residual[arc])
            if free_capacity == 0:
                continue
            to = int(graph.head[arc])
            if excess[to] < 0:
                pushed = min(left, free_capacity, -excess[to])
                excess[to] += pushed
                left -= pushed
                residual[arc] -= pushed
                residual[graph.sister[arc]] += pushed
                if left == 0:
                    break
        excess[node] = left


@part
def _plant_roots(graph: Graph, trees: Trees, queue: Queue) -> None:
    """Make each node with excess a root; roots with a residual arc to a free node are active.

    After `_push_adjacent` no arc from a source root to a sink root has residual capacity.
    """
    for node in range(len(graph.excess)):
        trees.parent[node] = TERMINAL if graph.excess[node] != 0 else NO_ARC
        trees.tree[node] = SINK if graph.excess[node] < 0 else SOURCE
        trees.distance[node] = 1
        trees.active[node] = 0
    for node in range(len(graph.excess)):
        if graph.excess[node] == 0:
            continue
        for arc in range(graph.first[node], graph.first[node + 1]):
            to = int(graph.head[arc])
            if graph.excess[to] == 0:
                back = graph.sister[arc]
                if graph.residual[arc if graph.excess[node] > 0 else back] > 0:
                    _activate(trees, queue, node)
                    break


@part
def _activate(trees: Trees, queue: Queue, node: int) -> None:
    """Append a node to the queue of active nodes, unless it is in it."""
    if trees.active[node] == 0:
        trees.active[node] = 1
        last = queue.ends[1]
        queue.active_nodes[last] = node
        queue.ends[1] = last + 1 if last + 1 < len(queue.active_nodes) else 0


# The search


@part
def _search(graph: Graph, trees: Trees, queue: Queue) -> None:
    """Grow, augment and adopt until no node is active."""
    active_nodes, ends, parent, active = queue.active_nodes, queue.ends, trees.parent, trees.active
    while ends[0] != ends[1]:
        node = int(active_nodes[ends[0]])
        while parent[node] != NO_ARC:
            tail, arc = _grow(graph, trees, queue, node)
            ends[4] += 1
            if arc < 0:
                break
            _augment(graph, trees, queue, tail, arc)
            _adopt(graph, trees, queue)
        active[node] = 0
        ends[0] = ends[0] + 1 if ends[0] + 1 < len(active_nodes) else 0


@part
def _grow(graph: Graph, trees: Trees, queue: Queue, node: int) -> tuple[int, int]:
    """Grow a node's tree by its free neighbours; where the trees touch, the source-side node and arc, else -1, -1."""
    residual, (parent, tree, timestamp, distance, _) = graph.residual, trees
    mine = tree[node]
    for arc in range(graph.first[node], graph.first[node + 1]):
        if mine == SOURCE and residual[arc] == 0:
            continue
        to = int(graph.head[arc])
        back = graph.sister[arc]
        if mine == SINK and residual[back] == 0:
            continue
        if parent[to] == NO_ARC:
            parent[to], tree[to], timestamp[to], distance[to] = back, mine, timestamp[node], distance[node] + 1
            _activate(trees, queue, to)
        elif tree[to] != mine:
            return (node, arc) if mine == SOURCE else (to, back)
        elif timestamp[to] <= timestamp[node] and distance[to] > distance[node]:
            parent[to], timestamp[to], distance[to] = back, timestamp[node], distance[node] + 1
    return -1, -1


@part
def _augment(graph: Graph, trees: Trees, queue: Queue, tail: int, bridge: int) -> None:
    """Push the bottleneck of the path through an arc between the trees; nodes below saturated arcs become orphans."""
    to = int(graph.head[bridge])
    amount = min(_bottleneck(graph, trees, tail), _bottleneck(graph, trees, to), int(graph.residual[bridge]))
    graph.residual[bridge] -= amount
    graph.residual[graph.sister[bridge]] += amount
    _push_along_path(graph, trees, queue, tail, amount)
    _push_along_path(graph, trees, queue, to, -amount)


@part
def _push_along_path(graph: Graph, trees: Trees, queue: Queue, node: int, amount: int) -> None:
    """Add flow to the path between a node and its terminal: from the source, or, if negative, to the sink."""
    residual, excess, parent = graph.residual, graph.excess, trees.parent
    while parent[node] >= 0:
        arc = int(parent[node])
        parent_node = int(graph.head[arc])
        back = graph.sister[arc]
        residual[arc] += amount
        residual[back] -= amount
        if residual[back if amount > 0 else arc] == 0:
            _make_orphan(trees, queue, node)
        node = parent_node
    excess[node] -= amount
    if excess[node] == 0:
        _make_orphan(trees, queue, node)


@part
def _bottleneck(graph: Graph, trees: Trees, node: int) -> int:
    """Residual capacity of the path between a node and its terminal."""
    least = int(_UNBOUNDED)
    from_source = trees.tree[node] == SOURCE
    arc = trees.parent[node]
    while arc >= 0:
        parent_node = int(graph.head[arc])
        carries = graph.sister[arc] if from_source else arc
        least = min(least, int(graph.residual[carries]))
        node, arc = parent_node, trees.parent[parent_node]
    return min(least, int(abs(graph.excess[node])))


@part
def _make_orphan(trees: Trees, queue: Queue, node: int) -> None:
    """Put a node behind a saturated arc at the front of the orphans."""
    trees.parent[node] = ORPHAN
    first = queue.ends[2] - 1 if queue.ends[2] > 0 else len(queue.orphans) - 1
    queue.orphans[first] = node
    queue.ends[2] = first


@part
def _adopt(graph: Graph, trees: Trees, queue: Queue) -> None:
    """Give each orphan the parent nearest to the terminal; without one it becomes free, its children orphans."""
    time = queue.ends[4]
    while queue.ends[2] != queue.ends[3]:
        node = int(queue.orphans[queue.ends[2]])
        queue.ends[2] = queue.ends[2] + 1 if queue.ends[2] + 1 < len(queue.orphans) else 0
        arc, away = _find_parent(graph, trees, node, time)
        trees.parent[node] = arc
        if arc >= 0:
            trees.timestamp[node], trees.distance[node] = time, away + 1
        else:
            _free(graph, trees, queue, node)


@part
def _find_parent(graph: Graph, trees: Trees, node: int, time: int) -> tuple[int, int]:
    """Arc to the neighbour with the shortest path to the terminal, and the length of that path."""
    residual, (parent, tree, timestamp, distance, _) = graph.residual, trees
    mine = tree[node]
    best, least = NO_ARC, _UNBOUNDED
    for arc in range(graph.first[node], graph.first[node + 1]):
        if mine == SINK and residual[arc] == 0:
            continue
        to = int(graph.head[arc])
        if mine == SOURCE and residual[graph.sister[arc]] == 0:
            continue
        if parent[to] == NO_ARC or tree[to] != mine:
            continue
        away, above = 0, to
        while timestamp[above] != time and parent[above] >= 0:
            away += 1
            above = int(graph.head[parent[above]])
        if timestamp[above] != time:
            if parent[above] != TERMINAL:
                continue
            timestamp[above], distance[above] = time, 1
        away += distance[above]
        if away < least:
            best, least = arc, away
        above = to
        while timestamp[above] != time:
            timestamp[above], distance[above] = time, away
            away -= 1
            above = int(graph.head[parent[above]])
    return best, least


@part
def _free(graph: Graph, trees: Trees, queue: Queue, node: int) -> None:
    """Free an orphan without a parent: neighbours with a residual arc to it are active, its children orphans."""
    mine = trees.tree[node]
    for arc in range(graph.first[node], graph.first[node + 1]):
        to = int(graph.head[arc])
        if trees.parent[to] == NO_ARC or trees.tree[to] != mine:
            continue
        back = graph.sister[arc]
        if graph.residual[back if mine == SOURCE else arc] > 0:
            _activate(trees, queue, to)
        if trees.parent[to] == back:
            trees.parent[to] = ORPHAN
            last = queue.ends[3]
            queue.orphans[last] = to
            queue.ends[3] = last + 1 if last + 1 < len(queue.orphans) else 0
