"""Maximum flow by two search trees (Boykov and Kolmogorov 2004).

A tree grows from the source and one from the sink. Where they touch, flow is pushed along the path; nodes whose way to
their terminal it saturates look for another way, and are free where there is none. Flow may have been pushed before the
search, and more arcs may be opened after it: it goes on with the trees that there are.

The source is 'occupied': a node with `excess` > 0 takes that much from it, one with `excess` < 0 gives that much to the
sink. When no node waits any more, the source's tree holds all that the source can still reach: of all minima, the one
with the smallest object set.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import part
from stseg.arrays import Bytes, Ints, Labels
from stseg.graphcut.graph import Graph, first_arc, head_of, sister_of

NO_ARC, TERMINAL, ORPHAN = -1, -2, -3
"""A node's way to its tree, where that is no arc: free; a root; cut off, and to be adopted."""
SOURCE, SINK = 0, 1
_FAR = 1 << 30


class Trees(NamedTuple):
    """Where each node hangs.

    Attributes
    ----------
    way : int32 (n,)
        Arc to the parent, or one of the codes above.
    side : uint8 (n,)
        The tree that a node with a way is in.
    stamp, distance : int32 (n,)
        How far from its terminal a node was at a time.
    waits : uint8 (n,)
        Whether it stands in the queue.
    """

    way: Labels
    side: Bytes
    stamp: Labels
    distance: Labels
    waits: Bytes


class Queue(NamedTuple):
    """Nodes of a range that wait to grow, and those cut off: two rings, and where they begin and end.

    Attributes
    ----------
    waiting, orphans : int32 (range + 1,)
    ends : int64 (5,)
        First and past the last of those waiting; of the orphans; the time.
    """

    waiting: Labels
    orphans: Labels
    ends: Ints


def new_trees(nodes: int) -> Trees:
    """Trees of a graph, not yet planted."""
    int32s = [np.zeros(nodes, np.int32) for _ in range(3)]
    return Trees(int32s[0], np.zeros(nodes, np.uint8), int32s[1], int32s[2], np.zeros(nodes, np.uint8))


def new_queue(nodes: int) -> Queue:
    """Queue for that many nodes."""
    return Queue(np.empty(nodes + 1, np.int32), np.empty(nodes + 1, np.int32), np.zeros(5, np.int64))


# Before the search


@part
def push_near(graph: Graph, begin: int, end: int) -> None:
    """Push what goes over one arc: from each node that takes from the source to neighbours that give to the sink.

    It is a flow like any other, and most of all that there will be: found in one sweep instead of path by path.
    """
    residual, excess = graph.residual, graph.excess
    for node in range(begin, end):
        left = excess[node]
        if left <= 0:
            continue
        for arc in range(first_arc(node, graph.first, graph.degree), first_arc(node + 1, graph.first, graph.degree)):
            room = np.int32(residual[arc])
            if room == 0:
                continue
            to = head_of(arc, node, graph.head, graph.degree, graph.lattice)
            if excess[to] < 0:
                pushed = min(left, room, -excess[to])
                excess[to] += pushed
                left -= pushed
                residual[arc] -= pushed
                residual[sister_of(arc, node, to, graph.sister, graph.degree)] += pushed
                if left == 0:
                    break
        excess[node] = left


@part
def plant(graph: Graph, trees: Trees, queue: Queue, begin: int, end: int) -> None:
    """Each node with excess is a root; those that can take in a free node wait to grow.

    Once `push_near` has gone over them, no arc from a root of the source to one of the sink can carry more.
    """
    for node in range(begin, end):
        trees.way[node] = TERMINAL if graph.excess[node] != 0 else NO_ARC
        trees.side[node] = SINK if graph.excess[node] < 0 else SOURCE
        trees.distance[node] = 1
        trees.waits[node] = 0
    for node in range(begin, end):
        if graph.excess[node] == 0:
            continue
        for arc in range(first_arc(node, graph.first, graph.degree), first_arc(node + 1, graph.first, graph.degree)):
            to = head_of(arc, node, graph.head, graph.degree, graph.lattice)
            if graph.excess[to] == 0:
                back = sister_of(arc, node, to, graph.sister, graph.degree)
                if graph.residual[arc if graph.excess[node] > 0 else back] > 0:
                    wait(trees, queue, node)
                    break


@part
def wait(trees: Trees, queue: Queue, node: int) -> None:
    """Put a node at the end of those that wait to grow, unless it is there."""
    if trees.waits[node] == 0:
        trees.waits[node] = 1
        last = queue.ends[1]
        queue.waiting[last] = node
        queue.ends[1] = last + 1 if last + 1 < len(queue.waiting) else 0


# The search


@part
def search(graph: Graph, trees: Trees, queue: Queue) -> None:
    """Grow, push and adopt until nothing waits any more."""
    waiting, ends, way, waits = queue.waiting, queue.ends, trees.way, trees.waits
    while ends[0] != ends[1]:
        node = int(waiting[ends[0]])
        while way[node] != NO_ARC:
            tail, arc = _grow(graph, trees, queue, node)
            ends[4] += 1
            if arc < 0:
                break
            _push(graph, trees, queue, tail, arc)
            _adopt(graph, trees, queue)
        waits[node] = 0
        ends[0] = ends[0] + 1 if ends[0] + 1 < len(waiting) else 0


@part
def _grow(graph: Graph, trees: Trees, queue: Queue, node: int) -> tuple[int, int]:
    """Take in free neighbours of a node; where it touches the other tree, the node and arc from source to sink."""
    residual, way, side, stamp, distance = graph.residual, trees.way, trees.side, trees.stamp, trees.distance
    mine = side[node]
    for arc in range(first_arc(node, graph.first, graph.degree), first_arc(node + 1, graph.first, graph.degree)):
        if mine == SOURCE and residual[arc] == 0:
            continue
        to = head_of(arc, node, graph.head, graph.degree, graph.lattice)
        back = sister_of(arc, node, to, graph.sister, graph.degree)
        if mine == SINK and residual[back] == 0:
            continue
        if way[to] == NO_ARC:
            way[to], side[to], stamp[to], distance[to] = back, mine, stamp[node], distance[node] + 1
            wait(trees, queue, to)
        elif side[to] != mine:
            return (node, arc) if mine == SOURCE else (to, back)
        elif stamp[to] <= stamp[node] and distance[to] > distance[node]:
            way[to], stamp[to], distance[to] = back, stamp[node], distance[node] + 1
    return -1, -1


@part
def _push(graph: Graph, trees: Trees, queue: Queue, tail: int, bridge: int) -> None:
    """Push what the path through an arc between the trees can carry; nodes behind what it saturates are orphans."""
    to = head_of(bridge, tail, graph.head, graph.degree, graph.lattice)
    amount = min(_room(graph, trees, tail), _room(graph, trees, to), int(graph.residual[bridge]))
    graph.residual[bridge] -= amount
    graph.residual[sister_of(bridge, tail, to, graph.sister, graph.degree)] += amount
    _carry(graph, trees, queue, tail, amount)
    _carry(graph, trees, queue, to, -amount)


@part
def _carry(graph: Graph, trees: Trees, queue: Queue, node: int, amount: int) -> None:
    """Book flow on the way between a node and its terminal: from the source, or, below 0, to the sink."""
    residual, excess, way = graph.residual, graph.excess, trees.way
    head, sister, lattice, degree = graph.head, graph.sister, graph.lattice, graph.degree
    while way[node] >= 0:
        arc = int(way[node])
        parent = head_of(arc, node, head, degree, lattice)
        back = sister_of(arc, node, parent, sister, degree)
        residual[arc] += amount
        residual[back] -= amount
        if residual[back if amount > 0 else arc] == 0:
            _cut_off(trees, queue, node)
        node = parent
    excess[node] -= amount
    if excess[node] == 0:
        _cut_off(trees, queue, node)


@part
def _room(graph: Graph, trees: Trees, node: int) -> int:
    """What the way from a node to its terminal can carry."""
    least = int(_FAR)
    from_source = trees.side[node] == SOURCE
    arc = trees.way[node]
    while arc >= 0:
        parent = head_of(arc, node, graph.head, graph.degree, graph.lattice)
        carries = sister_of(arc, node, parent, graph.sister, graph.degree) if from_source else arc
        least = min(least, int(graph.residual[carries]))
        node, arc = parent, trees.way[parent]
    return min(least, int(abs(graph.excess[node])))


@part
def _cut_off(trees: Trees, queue: Queue, node: int) -> None:
    """A node whose way is saturated: the next to be adopted."""
    trees.way[node] = ORPHAN
    first = queue.ends[2] - 1 if queue.ends[2] > 0 else len(queue.orphans) - 1
    queue.orphans[first] = node
    queue.ends[2] = first


@part
def _adopt(graph: Graph, trees: Trees, queue: Queue) -> None:
    """Find each orphan the parent nearest to the terminal, or let it go free and its children be orphans."""
    time = queue.ends[4]
    while queue.ends[2] != queue.ends[3]:
        node = int(queue.orphans[queue.ends[2]])
        queue.ends[2] = queue.ends[2] + 1 if queue.ends[2] + 1 < len(queue.orphans) else 0
        arc, away = _nearest_parent(graph, trees, node, time)
        trees.way[node] = arc
        if arc >= 0:
            trees.stamp[node], trees.distance[node] = time, away + 1
        else:
            _let_go(graph, trees, queue, node)


@part
def _nearest_parent(graph: Graph, trees: Trees, node: int, time: int) -> tuple[int, int]:
    """Of the arcs to neighbours whose way does lead to the terminal, the one with the fewest arcs behind it."""
    residual, way, side, stamp, distance = graph.residual, trees.way, trees.side, trees.stamp, trees.distance
    mine = side[node]
    best, least = NO_ARC, _FAR
    for arc in range(first_arc(node, graph.first, graph.degree), first_arc(node + 1, graph.first, graph.degree)):
        if mine == SINK and residual[arc] == 0:
            continue
        to = head_of(arc, node, graph.head, graph.degree, graph.lattice)
        if mine == SOURCE and residual[sister_of(arc, node, to, graph.sister, graph.degree)] == 0:
            continue
        if way[to] == NO_ARC or side[to] != mine:
            continue
        away, above = 0, to
        while stamp[above] != time and way[above] >= 0:
            away += 1
            above = head_of(way[above], above, graph.head, graph.degree, graph.lattice)
        if stamp[above] != time:
            if way[above] != TERMINAL:
                continue
            stamp[above], distance[above] = time, 1
        away += distance[above]
        if away < least:
            best, least = arc, away
        above = to
        while stamp[above] != time:
            stamp[above], distance[above] = time, away
            away -= 1
            above = head_of(way[above], above, graph.head, graph.degree, graph.lattice)
    return best, least


@part
def _let_go(graph: Graph, trees: Trees, queue: Queue, node: int) -> None:
    """A node that nobody adopts is free: neighbours that could take it in wait, its children are orphans."""
    mine = trees.side[node]
    for arc in range(first_arc(node, graph.first, graph.degree), first_arc(node + 1, graph.first, graph.degree)):
        to = head_of(arc, node, graph.head, graph.degree, graph.lattice)
        if trees.way[to] == NO_ARC or trees.side[to] != mine:
            continue
        back = sister_of(arc, node, to, graph.sister, graph.degree)
        if graph.residual[back if mine == SOURCE else arc] > 0:
            wait(trees, queue, to)
        if trees.way[to] == back:
            trees.way[to] = ORPHAN
            last = queue.ends[3]
            queue.orphans[last] = to
            queue.ends[3] = last + 1 if last + 1 < len(queue.orphans) else 0
