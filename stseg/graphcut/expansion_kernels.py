"""Kernels of the expansion: the two-label energy of a move, and the cells that need not be asked."""

from __future__ import annotations

from typing import NamedTuple

from stseg.accelerate import kernel
from stseg.arrays import Ints


class Neighbours(NamedTuple):
    """The neighbours of every cell: those of cell p are first[p] .. first[p + 1] - 1.

    Attributes
    ----------
    first : int64 (n + 1,)
    cell, weight : int64 (2 edge,)
        Which, and what it costs to differ from it, quanta.
    """

    first: Ints
    cell: Ints
    weight: Ints


class Arcs(NamedTuple):
    """Room for the edges of a move, int64 (edge,) each, as `least_cut` takes them."""

    start: Ints
    end: Ints
    forward: Ints
    backward: Ints

    def only(self, edges: int) -> Arcs:
        """The first edges."""
        return Arcs(self.start[:edges], self.end[:edges], self.forward[:edges], self.backward[:edges])


@kernel
def fill_neighbours(start: Ints, end: Ints, weight: Ints, near: Neighbours) -> None:
    """Fill the neighbours of every cell from its edges; near.first holds zeros."""
    for e in range(len(start)):
        near.first[start[e] + 1] += 1
        near.first[end[e] + 1] += 1
    for p in range(len(near.first) - 1):
        near.first[p + 1] += near.first[p]
    place = near.first.copy()
    for e in range(len(start)):
        p, q = start[e], end[e]
        near.cell[place[p]], near.weight[place[p]] = q, weight[e]
        near.cell[place[q]], near.weight[place[q]] = p, weight[e]
        place[p] += 1
        place[q] += 1


@kernel
def drop_settled(cells: Ints, near: Neighbours, changed: Ints, since: int, node: Ints, stack: Ints) -> None:
    """Set node to -1 for connected pieces of `cells` in and around which nothing changed since a move.

    What the label's last move left there was the best, and still is.

    Parameters
    ----------
    cells, near, node
        As of `fill_move`.
    changed : int64 (n,)
        The move by which each cell last changed.
    since
        The label's last move.
    stack : int64 (k,)
        Room for cells.
    """
    high = 0
    for k in range(len(cells)):
        p = cells[k]
        moved = changed[p] > since
        for i in range(near.first[p], near.first[p + 1]):
            moved = moved or changed[near.cell[i]] > since
        if moved:
            stack[high] = p
            high += 1
        else:
            node[p] = -2 - node[p]
    while high > 0:
        high -= 1
        p = stack[high]
        for i in range(near.first[p], near.first[p + 1]):
            q = near.cell[i]
            if node[q] <= -2:
                node[q] = -2 - node[q]
                stack[high] = q
                high += 1
    for k in range(len(cells)):
        if node[cells[k]] <= -2:
            node[cells[k]] = -1


@kernel
def drop_hopeless(
    alpha: int,
    cells: Ints,
    labels: Ints,
    near: Neighbours,
    node: Ints,
    gain: Ints,
    stack: Ints,
) -> None:
    """Set node to -1 for cells that gain nothing by taking alpha even if all the other cells take it.

    A cell gains the more, the more of its neighbours take alpha. So such cells are not in the smallest best set; and
    once they are known to stay, others gain less.

    Parameters
    ----------
    alpha, cells, labels, near, node
        As of `fill_move`.
    gain : int64 (k,)
        Gain of taking alpha by the cell's own costs; used up.
    stack : int64 (k,)
        Room for cells.
    """
    high = 0
    for k in range(len(cells)):
        p = cells[k]
        if node[p] < 0:
            continue
        for i in range(near.first[p], near.first[p + 1]):
            q, w = near.cell[i], near.weight[i]
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
        for i in range(near.first[p], near.first[p + 1]):
            q = near.cell[i]
            k = node[q]
            if k >= 0:
                gain[k] -= near.weight[i] if labels[q] != labels[p] else 2 * near.weight[i]
                if gain[k] <= 0:
                    node[q] = -1
                    stack[high] = q
                    high += 1


@kernel
def fill_move(
    alpha: int,
    cells: Ints,
    labels: Ints,
    near: Neighbours,
    node: Ints,
    unary: Ints,
    arcs: Arcs,
) -> int:
    """Fill the two-label energy of a move; the number of its edges.

    With x = 1 where a cell takes alpha, two neighbours pay w where one of them does, nothing where both do, and where
    neither does w [l_p != l_q]. With equal labels that is an edge both ways; with different ones it is
    w (1 - x_p) + w x_p (1 - x_q), a cost of p's own and an edge one way.

    Parameters
    ----------
    alpha
        The label that is offered.
    cells : int64 (k,)
        Whom: cells that do not have it.
    labels : int64 (n,)
        The labelling.
    node : int64 (n,)
        Index of each cell in `cells`, -1 for the others.
    unary : int64 (k,)
        Gain of taking alpha by the cell's own costs; what fixed neighbours add is added.
    arcs
        Filled with the edges between `cells`.
    """
    edges = 0
    for k in range(len(cells)):
        p = cells[k]
        for i in range(near.first[p], near.first[p + 1]):
            q, w = near.cell[i], near.weight[i]
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
