"""Multi-label Potts energy by expansion moves (Boykov, Veksler and Zabih, TPAMI 23(11), 2001).

    E(l) = sum_p D_p(l_p) + sum_(p,q) w_pq [l_p != l_q],     D_p(background) = 0

In an expansion move of label alpha every node takes alpha or keeps its label; the best such move is a minimum cut.
Moves go through the labels in ascending order until a whole round has changed nothing. Of several best moves the one
with the fewest changes is made, so each change lowers the energy and the result depends on energy and start alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.graphcut.expansion_kernels import (
    Arcs,
    Neighbours,
    fill_cheapest_labels,
    fill_move,
    fill_neighbours,
    prune_unchanged,
    prune_unprofitable,
)
from stseg.graphcut.sparse import sparse_cut

BACKGROUND = 0


@dataclass(frozen=True)
class LabelEnergy:
    """Unary costs and Potts weights of n nodes, quanta."""

    first: Ints
    """int64 (n + 1,): node p may have label[first[p]] .. label[first[p + 1] - 1] or the background at cost 0."""
    label: Ints
    """int64 (m,): 1 or more; ascending for each node."""
    cost: Ints
    """int64 (m,): D_p of that label, relative to the background."""
    start: Ints
    end: Ints
    """int64 (edge,) each: ends of each edge, which differ; each pair once."""
    weight: Ints
    """int64 (edge,): w: cost of different labels, 0 or more."""

    @property
    def cells(self) -> int:
        """n."""
        return len(self.first) - 1

    def of(self, labels: Ints) -> int:
        """Energy of a labelling int64 (n,), relative to all background."""
        differ = labels[self.start] != labels[self.end]
        return int(unary_costs(self, labels).sum()) + int(self.weight[differ].sum())

    def cheapest_labels(self) -> Ints:
        """Label of least unary cost of each node, int64 (n,); of several the first."""
        labels = np.full(self.cells, BACKGROUND, np.int64)
        fill_cheapest_labels(self.first, self.label, self.cost, labels)
        return labels


def unary_costs(energy: LabelEnergy, labels: Ints) -> Ints:
    """Unary cost of each node's label, int64 (n,).

    Raises
    ------
    ValueError
        If a label is not admissible at its node.
    """
    costs = np.zeros(energy.cells, np.int64)
    cell = np.repeat(np.arange(energy.cells), np.diff(energy.first))
    admissible = energy.label == labels[cell]
    costs[cell[admissible]] = energy.cost[admissible]
    label_count = np.bincount(cell[admissible], minlength=energy.cells) + (labels == BACKGROUND)
    if not (label_count == 1).all():
        raise ValueError("a node has an inadmissible label")
    return costs


def expand(energy: LabelEnergy, start: Ints, cut: Callable[..., Flags] = sparse_cut) -> Ints:
    """Labelling that no expansion move improves.

    Parameters
    ----------
    energy
        In quanta.
    start : int64 (n,)
        Initial labelling.
    cut
        Minimum cut of a move; the labels do not depend on it.

    Returns
    -------
    int64 (n,)
        Its energy is at most that of `start`.
    """
    moves = Moves(energy, start, cut)
    idle = 0
    while idle < len(moves.alphabet):
        for alpha in moves.alphabet:
            idle = 0 if moves.move(alpha) else idle + 1
            if idle == len(moves.alphabet):
                break
    return moves.labels


class Moves:
    """Current labelling and its expansion moves.

    Parameters
    ----------
    energy, start, cut
        As of `expand`.
    """

    def __init__(self, energy: LabelEnergy, start: Ints, cut: Callable[..., Flags] = sparse_cut) -> None:
        self._cut = cut
        self.labels = start.astype(np.int64)
        """int64 (n,): current labelling."""
        self._cost = unary_costs(energy, self.labels)
        self._cells_by_label = _cells_by_label(energy)
        self.alphabet = sorted(self._cells_by_label)
        """All labels, ascending, the background first."""
        cells, edges = energy.cells, len(energy.start)
        self._adjacency = Neighbours(
            np.zeros(cells + 1, np.int64), np.empty(2 * edges, np.int64), np.empty(2 * edges, np.int64)
        )
        fill_neighbours(energy.start, energy.end, energy.weight, self._adjacency)
        self._arcs = Arcs(*np.empty((4, edges), np.int64))
        self._node = np.full(cells, -1, np.int64)
        self._moves, self._last_changed, self._last_moved = 0, np.zeros(cells, np.int64), dict[int, int]()

    def move(self, alpha: int) -> int:
        """Make the best expansion of one label; number of nodes that changed."""
        cells, costs = self._candidates(alpha)
        if not len(cells):
            return 0
        unary = self._cost[cells] - costs
        self._node[cells] = np.arange(len(cells))
        edges = fill_move(alpha, cells, self.labels, self._adjacency, self._node, unary, self._arcs)
        self._node[cells] = -1
        takes = self._cut(unary, *self._arcs.only(edges))
        self.labels[cells[takes]] = alpha
        self._cost[cells[takes]] = costs[takes]
        self._last_changed[cells[takes]] = self._moves
        return int(takes.sum())

    def _candidates(self, alpha: int) -> tuple[Ints, Ints]:
        """Nodes that could gain by the label if all others took it, and their costs."""
        cells, costs = self._cells_by_label[alpha]
        self._moves += 1
        since, self._last_moved[alpha] = self._last_moved.get(alpha, -1), self._moves
        without: Flags = self.labels[cells] != alpha
        cells, costs = cells[without], costs[without]
        self._node[cells] = np.arange(len(cells))
        stack = np.empty_like(cells)
        prune_unchanged(cells, self._adjacency, self._last_changed, since, self._node, stack)
        prune_unprofitable(alpha, cells, self.labels, self._adjacency, self._node, self._cost[cells] - costs, stack)
        left = self._node[cells] >= 0
        self._node[cells] = -1
        return cells[left], costs[left]


def _cells_by_label(energy: LabelEnergy) -> dict[int, tuple[Ints, Ints]]:
    """For each label its admissible nodes, ascending, and their costs."""
    cell = np.repeat(np.arange(energy.cells), np.diff(energy.first))
    order = np.argsort(energy.label, kind="stable")
    labels, begin = np.unique(energy.label[order], return_index=True)
    cells_by_label = {BACKGROUND: (np.arange(energy.cells), np.zeros(energy.cells, np.int64))}
    for label, entries in zip(labels.tolist(), np.split(order, begin[1:]), strict=bool(len(labels))):
        cells_by_label[label] = cell[entries], energy.cost[entries]
    return cells_by_label
