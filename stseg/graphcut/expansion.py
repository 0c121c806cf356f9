"""Many labels at once by alpha-expansion (Boykov, Veksler and Zabih, TPAMI 23(11), 2001; METHODS 4).

    E(l) = sum_p D_p(l_p) + sum_(p,q) w_pq [l_p != l_q],     D_p(background) = 0

One move offers a label alpha to every cell at once: each takes it or keeps its own. The best of all such moves is a
minimum cut of two labels. Moves go through the labels in rising order, again and again, until a whole round has changed
nothing. A move takes the smallest set of cells among the best, so none is taken that gains nothing: every change lowers
the energy, and the end depends on nothing but the energy and the start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.graphcut.compact import least_cut
from stseg.graphcut.expansion_kernels import (
    Arcs,
    Neighbours,
    drop_hopeless,
    drop_settled,
    fill_move,
    fill_neighbours,
)

BACKGROUND = 0


@dataclass(frozen=True)
class LabelEnergy:
    """The energy of labellings of n cells, in quanta.

    Attributes
    ----------
    first : int64 (n + 1,)
        Cell p may have the labels first[p] .. first[p + 1] - 1 of `label`, or the background, which costs nothing.
    label : int64 (m,)
        1 or more; rising for each cell.
    cost : int64 (m,)
        D_p of that label, relative to the background.
    start, end : int64 (edge,)
        Two different neighbours; each pair once.
    weight : int64 (edge,)
        What it costs that they differ, 0 or more.
    """

    first: Ints
    label: Ints
    cost: Ints
    start: Ints
    end: Ints
    weight: Ints

    @property
    def cells(self) -> int:
        """n."""
        return len(self.first) - 1

    def of(self, labels: Ints) -> int:
        """Energy of a labelling, int64 (n,), relative to everything background."""
        differ = labels[self.start] != labels[self.end]
        return int(own_costs(self, labels).sum()) + int(self.weight[differ].sum())

    def best(self) -> Ints:
        """Each cell's cheapest label by itself, int64 (n,); of several the first."""
        cell = np.repeat(np.arange(self.cells), np.diff(self.first))
        order = np.lexsort((self.label, self.cost, cell))
        cheapest = order[np.unique(cell[order], return_index=True)[1]]
        labels = np.full(self.cells, BACKGROUND, np.int64)
        gains = cheapest[self.cost[cheapest] < 0]
        labels[cell[gains]] = self.label[gains]
        return labels


def own_costs(energy: LabelEnergy, labels: Ints) -> Ints:
    """D_p of each cell's label, int64 (n,); every label must be one that its cell may have."""
    costs = np.zeros(energy.cells, np.int64)
    cell = np.repeat(np.arange(energy.cells), np.diff(energy.first))
    taken = energy.label == labels[cell]
    costs[cell[taken]] = energy.cost[taken]
    met = np.bincount(cell[taken], minlength=energy.cells) + (labels == BACKGROUND)
    if not (met == 1).all():
        raise ValueError("a cell has a label that it may not have")
    return costs


def expand(energy: LabelEnergy, start: Ints) -> Ints:
    """A labelling that no expansion move betters.

    Parameters
    ----------
    energy
        In quanta.
    start : int64 (n,)
        The labelling to begin with.

    Returns
    -------
    int64 (n,)
        Its energy is never above that of `start`.
    """
    moves = Moves(energy, start)
    idle = 0
    while idle < len(moves.alphabet):
        for alpha in moves.alphabet:
            idle = 0 if moves.move(alpha) else idle + 1
            if idle == len(moves.alphabet):
                break
    return moves.labels


class Moves:
    """A labelling, and the moves that lower its energy.

    Parameters
    ----------
    energy, start
        As of `expand`.

    Attributes
    ----------
    labels : int64 (n,)
        The labelling so far.
    alphabet
        All labels, the background first.
    """

    def __init__(self, energy: LabelEnergy, start: Ints) -> None:
        self.labels = start.astype(np.int64)
        self._cost = own_costs(energy, self.labels)
        self._offers = _offers(energy)
        self.alphabet = sorted(self._offers)
        cells, edges = energy.cells, len(energy.start)
        self._near = Neighbours(
            np.zeros(cells + 1, np.int64), np.empty(2 * edges, np.int64), np.empty(2 * edges, np.int64)
        )
        fill_neighbours(energy.start, energy.end, energy.weight, self._near)
        self._arcs = Arcs(*np.empty((4, edges), np.int64))
        self._node = np.full(cells, -1, np.int64)
        self._clock, self._changed, self._asked = 0, np.zeros(cells, np.int64), dict[int, int]()

    def move(self, alpha: int) -> int:
        """The best expansion of one label; how many cells took it."""
        cells, costs = self._candidates(alpha)
        if not len(cells):
            return 0
        unary = self._cost[cells] - costs
        self._node[cells] = np.arange(len(cells))
        edges = fill_move(alpha, cells, self.labels, self._near, self._node, unary, self._arcs)
        self._node[cells] = -1
        takes = least_cut(unary, *self._arcs.only(edges))
        self.labels[cells[takes]] = alpha
        self._cost[cells[takes]] = costs[takes]
        self._changed[cells[takes]] = self._clock
        return int(takes.sum())

    def _candidates(self, alpha: int) -> tuple[Ints, Ints]:
        """Cells that may gain by taking the label if enough others do, and what it costs them."""
        cells, costs = self._offers[alpha]
        self._clock += 1
        since, self._asked[alpha] = self._asked.get(alpha, -1), self._clock
        without: Flags = self.labels[cells] != alpha
        cells, costs = cells[without], costs[without]
        self._node[cells] = np.arange(len(cells))
        room = np.empty_like(cells)
        drop_settled(cells, self._near, self._changed, since, self._node, room)
        drop_hopeless(alpha, cells, self.labels, self._near, self._node, self._cost[cells] - costs, room)
        left = self._node[cells] >= 0
        self._node[cells] = -1
        return cells[left], costs[left]


def _offers(energy: LabelEnergy) -> dict[int, tuple[Ints, Ints]]:
    """For each label the cells that may have it, rising, and what it costs them."""
    cell = np.repeat(np.arange(energy.cells), np.diff(energy.first))
    order = np.argsort(energy.label, kind="stable")
    labels, begin = np.unique(energy.label[order], return_index=True)
    offers = {BACKGROUND: (np.arange(energy.cells), np.zeros(energy.cells, np.int64))}
    for label, entries in zip(labels.tolist(), np.split(order, begin[1:]), strict=bool(len(labels))):
        offers[label] = cell[entries], energy.cost[entries]
    return offers
