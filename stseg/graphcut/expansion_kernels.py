"""Kernels of the expansion: binary energy of a move, and nodes that cannot change in it."""

from __future__ import annotations

from typing import NamedTuple

from stseg.arrays import Ints
from stseg.kernels.accelerate import kernel


class Neighbours(NamedTuple):
    """Neighbours in compressed rows: those of node p are first[p] .. first[p + 1] - 1."""

    first: Ints
    """int64 (n + 1,)."""
    cell: Ints
    weight: Ints
    """int64 (2 edge,) each: neighbour and Potts weight, quanta."""


class Arcs(NamedTuple):
    """Buffer for the edges of a move, int64 (edge,) each, as arguments of `sparse_cut`."""

    start: Ints
    end: Ints
    forward: Ints
    backward: Ints

    def only(self, edges: int) -> Arcs:
        """View of the first edges."""
        return Arcs(self.start[:edges], self.end[:edges], self.forward[:edges], self.backward[:edges])


@kernel
def fill_cheapest_labels(first: Ints, label: Ints, cost: Ints, labels: Ints) -> None:
    """Fill labels (n,), which hold the background, with those of least cost below 0; of several the first."""
    for p in range(len(labels)):
        least = 0
        for k in range(first[p], first[p + 1]):
            if cost[k] < least:
                least, labels[p] = cost[k], label[k]


@kernel
def fill_neighbours(start: Ints, end: Ints, weight: Ints, adjacency: Neighbours) -> None:
    """Fill the neighbours of all nodes from the edges; adjacency.first holds zeros."""
    for e in range(len(start)):
        adjacency.first[start[e] + 1] += 1
        adjacency.first[end[e] + 1] += 1
    for p in range(len(adjacency.first) - 1):
        adjacency.first[p + 1] += adjacency.first[p]
    place = adjacency.first.copy()
    for e in range(len(start)):
        p, q = start[e], end[e]
        adjacency.cell[place[p]], adjacency.weight[place[p]] = q, weight[e]
        adjacency.cell[place[q]], adjacency.weight[place[q]] = p, weight[e]
        place[p] += 1
        place[q] += 1


@kernel
def prune_unchanged(cells: Ints, adjacency: Neighbours, changed: Ints, since: int, node: Ints, stack: Ints) -> None:
    """Set node to -1 for components of `cells` in and around which nothing changed since a move.

    The result of the label's last move is still optimal there.

    Parameters
    ----------
    cells, adjacency, node
        As of `fill_move`.
    changed : int64 (n,)
        Move in which each node last changed.
    since
        Last move of the label.
    stack : int64 (k,)
        Buffer.
    """
    high = 0
    for k in range(len(cells)):
        p = cells[k]
        moved = changed[p] > since
        for i in range(adjacency.first[p], adjacency.first[p + 1]):
            moved = moved or changed[adjacency.cell[i]] > since
        if moved:
            stack[high] = p
            high += 1
        else:
            node[p] = -2 - node[p]
    while high > 0:
        high -= 1
        p = stack[high]
        for i in range(adjacency.first[p], adjacency.first[p + 1]):
            q = adjacency.cell[i]
            if node[q] <= -2:
                node[q] = -2 - node[q]
                stack[high] = q
                high += 1
    for k in range(len(cells)):
        if node[cells[k]] <= -2:
            node[cells[k]] = -1


@kernel
def prune_unprofitable(
    alpha: int, cells: Ints, labels: Ints, adjacency: Neighbours, node: Ints, gain: Ints, stack: Ints
) -> None:
    """Set node to -1 for nodes that gain nothing by alpha even if all other nodes take it.

    The gain of a node rises with the number of neighbours that take alpha, so such nodes are not in the smallest
    optimal set. Once they are known to stay, others gain less.

    Parameters
    ----------
    alpha, cells, labels, adjacency, node
        As of `fill_move`.
    gain : int64 (k,)
        Gain of alpha by unary costs; overwritten.
    stack : int64 (k,)
        Buffer.
    """
    high = 0
    for k in range(len(cells)):
        p = cells[k]
        if node[p] < 0:
            continue
        for i in range(adjacency.first[p], adjacency.first[p + 1]):
            q, w = adjacency.cell[i], adjacency.weight[i]
            if node[q] >= 0 or labels[q] == alpha:
                gain[k] += w
            elif labels[q] == labels[p]:
                gain[k] -= w
    for k in range(len(cells)):
        if node[cells[k]] >= 0 and gain[k] <= 0:
            node[cells[k]] = -1
            stack[high] = cells[k]
            high += 1
    while high > 0:
        high -= 1
        p = stack[high]
        for i in range(adjacency.first[p], adjacency.first[p + 1]):
            q = adjacency.cell[i]
            k = node[q]
            if k >= 0:
                gain[k] -= adjacency.weight[i] if labels[q] != labels[p] else 2 * adjacency.weight[i]
                if gain[k] <= 0:
                    node[q] = -1
                    stack[high] = q
                    high += 1


@kernel
def fill_move(alpha: int, cells: Ints, labels: Ints, adjacency: Neighbours, node: Ints, unary: Ints, arcs: Arcs) -> int:
    """Fill the binary energy of a move; number of its edges.

    With x = 1 where a node takes alpha, an edge costs w for x_p != x_q, 0 for x_p = x_q = 1 and w [l_p != l_q] for
    x_p = x_q = 0. For equal labels that is a symmetric n-link; for different ones it is
    w (1 - x_p) + w x_p (1 - x_q), a unary term and a one-way n-link.

    Parameters
    ----------
    alpha
        Label of the move.
    cells : int64 (k,)
        Candidate nodes, which have other labels.
    labels : int64 (n,)
        Current labelling.
    node : int64 (n,)
        Index of each node in `cells`, -1 for the others.
    unary : int64 (k,)
        Gain of alpha by unary costs; contributions of fixed neighbours are added.
    arcs
        Receives the edges between `cells`.
    """
    edges = 0
    for k in range(len(cells)):
        p = cells[k]
        for i in range(adjacency.first[p], adjacency.first[p + 1]):
            q, w = adjacency.cell[i], adjacency.weight[i]
            if node[q] < 0:
                if labels[q] != labels[p]:
                    unary[k] += w
                if labels[q] != alpha:
                    unary[k] -= w
            elif p < q:
                arcs.start[edges], arcs.end[edges], arcs.forward[edges], arcs.backward[edges] = k, node[q], w, w
                if labels[q] != labels[p]:
                    arcs.backward[edges] = 0
                    unary[k] += w
                edges += 1
    return edges
