"""Quadratic binary energies with attraction and repulsion: roof duality (Kolmogorov and Rother, TPAMI 29(7), 2007).

    E(x) = sum_p a_p x_p + sum_(p,q) b_pq x_p x_q,     x_p 0 or 1

Where no b is positive the energy is submodular, and one minimum cut is exact. Otherwise a cut of twice the nodes, x_p
and its complement, gives a lower bound and labels of some nodes that a global minimum has too. The other nodes fall
into components: small ones are enumerated, larger ones improved by flips of one or two nodes, which can leave a gap.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stseg.arrays import Flags, Ints
from stseg.graphcut.sparse import sparse_cut

COMPONENT_LIMIT = 12
"""Largest component of undecided nodes that is enumerated."""


@dataclass(frozen=True)
class QuadraticEnergy:
    """Terms of n binary variables, quanta."""

    unary: Ints
    """int64 (n,): a."""
    start: Ints
    end: Ints
    weight: Ints
    """int64 (edge,) each: two different nodes and b: attraction below 0, repulsion above."""

    def of(self, labels: Flags) -> int:
        """Energy of labels, bool (n,)."""
        both = labels[self.start] & labels[self.end]
        return int(self.unary[labels].sum()) + int(self.weight[both].sum())


@dataclass(frozen=True)
class QuadraticMinimum:
    """Labels of low energy."""

    labels: Flags
    """bool (n,)."""
    gap: int
    """Bound on the distance from the least energy, quanta; 0 where the labels are a global minimum."""


def minimise(energy: QuadraticEnergy, cut: Callable[..., Flags] = sparse_cut) -> QuadraticMinimum:
    """Labels of least energy, or close to it with a bound."""
    if not (energy.weight > 0).any():
        return QuadraticMinimum(_submodular(energy, cut), 0)
    labels, open_, bound = _roof_dual(energy, cut)
    exact = True
    for nodes in _components(energy, open_):
        if len(nodes) <= COMPONENT_LIMIT:
            _enumerate(energy, labels, nodes)
        else:
            exact = False
            _improve(energy, labels, nodes)
    gap = 0 if exact else max(energy.of(labels) - bound, 0)
    return QuadraticMinimum(labels, gap)


def _submodular(energy: QuadraticEnergy, cut: Callable[..., Flags]) -> Flags:
    gain = -energy.unary
    np.subtract.at(gain, energy.start, energy.weight)
    return cut(gain, energy.start, energy.end, -energy.weight, np.zeros_like(energy.weight))


def _roof_dual(energy: QuadraticEnergy, cut: Callable[..., Flags]) -> tuple[Flags, Flags, int]:
    """Labels, nodes without one (labelled 0), and the lower bound."""
    n = len(energy.unary)
    attract = energy.weight < 0
    p, q, a = energy.start[attract], energy.end[attract], -energy.weight[attract]
    r, s, c = energy.start[~attract], energy.end[~attract], energy.weight[~attract]
    unary = energy.unary.copy()
    np.subtract.at(unary, p, a)
    start, end = np.concatenate([p, n + q, r, s]), np.concatenate([q, n + p, n + s, n + r])
    weight = np.concatenate([a, a, c, c])
    gain = np.concatenate([-unary, unary])
    in_source = cut(gain, start, end, weight, np.zeros_like(weight))
    doubled = -int(gain[in_source].sum()) + int(weight[in_source[start] & ~in_source[end]].sum()) + int(unary.sum())
    label, complement = in_source[:n], in_source[n:]
    return label & ~complement, np.asarray(label == complement), -(-doubled // 2)


def _components(energy: QuadraticEnergy, open_: Flags) -> list[Ints]:
    """Connected components of the open nodes."""
    if not open_.any():
        return []
    inner = open_[energy.start] & open_[energy.end] & (energy.weight != 0)
    piece = connected(energy.start[inner], energy.end[inner], len(open_))
    return [np.flatnonzero((piece == k) & open_) for k in np.unique(piece[open_])]


def connected(start: Ints, end: Ints, size: int) -> Ints:
    """Connected component of each of some nodes by edges between them, from 0, int64 (size,)."""
    graph = csr_array((np.ones(len(start), bool), (start, end)), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _enumerate(energy: QuadraticEnergy, labels: Flags, nodes: Ints) -> None:
    """Label nodes by their best combination; of several the first with the fewest ones."""
    local = _restricted(energy, labels, nodes)
    choices = np.array(sorted(product((False, True), repeat=len(nodes)), key=sum), bool)
    values = choices @ local.unary
    for p, q, w in zip(local.start, local.end, local.weight, strict=True):
        values = values + w * (choices[:, p] & choices[:, q])
    labels[nodes] = choices[values.argmin()]


def _improve(energy: QuadraticEnergy, labels: Flags, nodes: Ints) -> None:
    """Flip one node, or both ends of an edge, while that lowers the energy, from the labels of the unary terms."""
    local = _restricted(energy, labels, nodes)
    table = np.zeros((len(nodes), len(nodes)), np.int64)
    np.add.at(table, (local.start, local.end), local.weight)
    np.add.at(table, (local.end, local.start), local.weight)
    x = np.zeros(len(nodes), bool)
    while True:
        change = np.where(x, -1, 1) * (local.unary + table @ x)
        sign = np.where(x, -1, 1)
        both = change[:, None] + change + table * sign[:, None] * sign
        np.fill_diagonal(both, change)
        i, j = np.unravel_index(both.argmin(), both.shape)
        if both[i, j] >= 0:
            break
        x[[i, j]] ^= True
        if i == j:
            x[i] = sign[i] > 0
    labels[nodes] = x


def _restricted(energy: QuadraticEnergy, labels: Flags, nodes: Ints) -> QuadraticEnergy:
    """Energy of some nodes, all others fixed."""
    number = np.full(len(labels), -1)
    number[nodes] = np.arange(len(nodes))
    start, end = number[energy.start], number[energy.end]
    unary = energy.unary[nodes].copy()
    for one, other in ((energy.start, energy.end), (energy.end, energy.start)):
        touching = (number[one] >= 0) & (number[other] < 0) & labels[other]
        np.add.at(unary, number[one][touching], energy.weight[touching])
    inner = (start >= 0) & (end >= 0)
    return QuadraticEnergy(unary, start[inner], end[inner], energy.weight[inner])
