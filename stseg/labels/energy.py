"""The energy of the labels of one view (HW12 eq. 22 with the statuses given), for an expansion.

    E(l) = sum_p [ c1 (q_p [l_p = 0] + (1 - q_p) [l_p > 0]) - log p(l_p | S) ] + sum_(p,q) w_pq [l_p != l_q]

with q the foreground's probability of a person, soft where HW12's is 0 or 1 (eqs 13 to 15). All is told relative to
background, pixel by pixel. A label that costs a pixel more than all its edges can give back is in no minimum; so what
is left are the pixels in and around what moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Ints, Labels, Singles
from stseg.config import LabelConfig
from stseg.graphcut.energy import QUANTUM
from stseg.graphcut.expansion import BACKGROUND, LabelEnergy
from stseg.labels.label_likelihood import LabelLikelihood


@dataclass(frozen=True)
class PixelEnergy:
    """Pixels that may show somebody, and the energy of their labels.

    Attributes
    ----------
    pixel : int64 (n,)
        Their indices in the flattened window, rising.
    energy
        Label j + 1 is person j.
    """

    pixel: Ints
    energy: LabelEnergy


def pixel_energy(
    shown: LabelLikelihood, foreground: Singles, across: Labels, down: Labels, config: LabelConfig
) -> PixelEnergy:  # fmt: skip
    """The energy of a window of a view.

    Parameters
    ----------
    shown
        The label likelihood, and with it the window.
    foreground : float32 (v, u)
        q in the window.
    across, down : int32 (v, u)
        w to the next pixel of the row and to the one below, quanta.
    """
    edges = shown.people.edges - np.tile([shown.left, shown.top], 2)
    known = (edges, shown.people.first, shown.people.share, shown.nobody)
    around = _around(across, down)
    cost = np.empty(len(shown.people.share), np.int64)
    _fill_costs(*known, foreground, config.detection, config.outside / (len(edges) + 1), QUANTUM, cost)
    count, node = np.zeros(foreground.shape, np.int64), np.full(foreground.shape, -1, np.int64)
    _count_labels(edges, cost, around, count)
    pixel = np.flatnonzero(count)
    node.flat[pixel] = np.arange(len(pixel))
    first = np.append(0, np.cumsum(count.flat[pixel]))
    label, price = np.empty(first[-1], np.int64), np.empty(first[-1], np.int64)
    start, end, weight = (np.empty(2 * len(pixel), np.int64) for _ in range(3))
    border = np.zeros(len(pixel), np.int64)
    joined = _fill_neighbours(node, across, down, start, end, weight, border)
    _fill_labels(edges, cost, around, node, border, first[:-1].copy(), label, price)
    return PixelEnergy(pixel, LabelEnergy(first, label, price, start[:joined], end[:joined], weight[:joined]))


def most_likely(shown: LabelLikelihood) -> Ints:
    """The label of greatest likelihood at each pixel of the window (HW12 eq. 24), int64 (v, u)."""
    best, label = shown.nobody.copy(), np.zeros(shown.nobody.shape, np.int64)
    for j, (left, top, right, bottom) in enumerate(shown.people.edges.tolist()):
        here = np.s_[top - shown.top : bottom - shown.top, left - shown.left : right - shown.left]
        share = shown.people.share[shown.people.first[j] : shown.people.first[j + 1]].reshape(best[here].shape)
        label[here][share > best[here]] = j + 1
        np.maximum(best[here], share, out=best[here])
    return label


def admissible(energy: LabelEnergy, labels: Ints) -> Ints:
    """Labels of cells, int64 (n,), background where a cell may not have its own."""
    cell = np.repeat(np.arange(energy.cells), np.diff(energy.first))
    allowed = np.zeros(energy.cells, bool)
    allowed[cell[energy.label == labels[cell]]] = True
    return np.where(allowed, labels, BACKGROUND)


def _around(across: Labels, down: Labels) -> Labels:
    """Sum of each pixel's edges, quanta."""
    around = across + down
    around[:, 1:] += across[:, :-1]
    around[1:] += down[:-1]
    return around


@kernel
def _fill_costs(
    edges: Ints,
    first: Ints,
    share: Singles,
    nobody: Singles,
    foreground: Singles,
    detection: float,
    least: float,
    quantum: float,
    cost: Ints,
) -> None:
    """Fill cost with that of each person at each pixel of their rectangle, relative to background, quanta."""
    for j in range(len(edges)):
        i = first[j]
        for v in range(edges[j, 1], edges[j, 3]):
            for u in range(edges[j, 0], edges[j, 2]):
                likelihood = np.log((nobody[v, u] + least) / (share[i] + least))
                cost[i] = round((detection * (1.0 - 2.0 * foreground[v, u]) + likelihood) / quantum)
                i += 1


@kernel
def _count_labels(edges: Ints, cost: Ints, around: Labels, count: Ints) -> None:
    """Fill count (v, u) with how many people each pixel may show."""
    i = 0
    for j in range(len(edges)):
        for v in range(edges[j, 1], edges[j, 3]):
            for u in range(edges[j, 0], edges[j, 2]):
                if cost[i] < around[v, u]:
                    count[v, u] += 1
                i += 1


@kernel
def _fill_labels(
    edges: Ints, cost: Ints, around: Labels, node: Ints, border: Ints, free: Ints, label: Ints, price: Ints
) -> None:  # fmt: skip
    """Fill the labels that each pixel may have, rising, and what they cost; `free` is each pixel's next free place."""
    i = 0
    for j in range(len(edges)):
        for v in range(edges[j, 1], edges[j, 3]):
            for u in range(edges[j, 0], edges[j, 2]):
                if cost[i] < around[v, u]:
                    p = node[v, u]
                    label[free[p]], price[free[p]] = j + 1, cost[i] + border[p]
                    free[p] += 1
                i += 1


@kernel
def _fill_neighbours(
    node: Ints, across: Labels, down: Labels, start: Ints, end: Ints, weight: Ints, border: Ints
) -> int:  # fmt: skip
    """Fill the edges between pixels that may show somebody, and what those to all others cost; how many there are."""
    joined = 0
    rows, columns = node.shape
    for v in range(rows):
        for u in range(columns):
            for way in range(2):
                to_v, to_u = v + way, u + 1 - way
                if to_v == rows or to_u == columns:
                    continue
                p, q = node[v, u], node[to_v, to_u]
                w = down[v, u] if way == 1 else across[v, u]
                if p >= 0 and q >= 0:
                    if w > 0:
                        start[joined], end[joined], weight[joined] = p, q, w
                        joined += 1
                elif p >= 0:
                    border[p] += w
                elif q >= 0:
                    border[q] += w
    return joined
