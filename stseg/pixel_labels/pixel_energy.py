"""Energy of the pixel labels of one view (Huang and Wang 2012, eq. 22 with statuses given).

    E(l) = sum_p [ c1 (q_p [l_p = 0] + (1 - q_p) [l_p > 0]) - log p(l_p | S) - a_p(l_p) ] + sum_(p,q) w_pq [l_p != l_q]

a is the log-ratio of colours (`colour_ratios`), 0 without. q is the foreground probability of a person,
where the paper has 0 or 1 (eqs 13 to 15). Costs are relative to the background, pixel by pixel. A label that costs a
pixel more than the sum of its edges is in no minimum, so only pixels in and around people are nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Singles
from stseg.config import LabelConfig
from stseg.graphcut.expansion import BACKGROUND, LabelEnergy
from stseg.graphcut.grid_energy import QUANTUM
from stseg.kernels.accelerate import kernel
from stseg.pixel_labels.label_likelihood import LabelLikelihood


@dataclass(frozen=True)
class PixelEnergy:
    """Pixels with admissible labels, and the energy of their labels.

    Attributes
    ----------
    pixel : int64 (n,)
        Indices in the flattened window, ascending.
    energy
        Label j + 1 is person j.
    """

    pixel: Ints
    energy: LabelEnergy


def pixel_energy(
    prior: LabelLikelihood,
    foreground: Singles,
    across: Labels,
    down: Labels,
    config: LabelConfig,
    colour: Singles | None = None,
) -> PixelEnergy:
    """Energy of an image window.

    Parameters
    ----------
    prior
        Label likelihood, which defines the window.
    foreground : float32 (v, u)
        q in the window.
    across, down : int32 (v, u)
        w to the next pixel in the row and in the column, quanta.
    colour : float32 (m,)
        a of each person at the pixels of the rectangle, nats; None without colours.
    """
    edges = prior.people.edges - np.tile([prior.left, prior.top], 2)
    patches = (edges, prior.people.first, prior.people.share, prior.background)
    edge_sums = _edge_sums(across, down)
    cost = np.empty(len(prior.people.share), np.int64)
    _fill_costs(*patches, foreground, config.foreground_weight, config.outlier_rate / (len(edges) + 1), QUANTUM, cost)
    count, node = np.zeros(foreground.shape, np.int64), np.full(foreground.shape, -1, np.int64)
    if colour is not None:
        cost -= np.rint(colour / QUANTUM).astype(np.int64)
    _count_labels(edges, cost, edge_sums, count)
    pixel = np.flatnonzero(count)
    node.flat[pixel] = np.arange(len(pixel))
    first = np.append(0, np.cumsum(count.flat[pixel]))
    label, price = np.empty(first[-1], np.int64), np.empty(first[-1], np.int64)
    start, end, weight = (np.empty(2 * len(pixel), np.int64) for _ in range(3))
    border = np.zeros(len(pixel), np.int64)
    edges_filled = _fill_neighbours(node, across, down, start, end, weight, border)
    _fill_labels(edges, cost, edge_sums, node, border, first[:-1].copy(), label, price)
    return PixelEnergy(
        pixel, LabelEnergy(first, label, price, start[:edges_filled], end[:edges_filled], weight[:edges_filled])
    )


def most_likely_labels(prior: LabelLikelihood) -> Ints:
    """Label of greatest likelihood at each pixel of the window (eq. 24), int64 (v, u)."""
    best, label = prior.background.copy(), np.zeros(prior.background.shape, np.int64)
    for j, (left, top, right, bottom) in enumerate(prior.people.edges.tolist()):
        here = np.s_[top - prior.top : bottom - prior.top, left - prior.left : right - prior.left]
        share = prior.people.share[prior.people.first[j] : prior.people.first[j + 1]].reshape(best[here].shape)
        label[here][share > best[here]] = j + 1
        np.maximum(best[here], share, out=best[here])
    return label


def admissible(energy: LabelEnergy, labels: Ints) -> Ints:
    """Labels int64 (n,), replaced by the background where inadmissible."""
    cell = np.repeat(np.arange(energy.cells), np.diff(energy.first))
    allowed = np.zeros(energy.cells, bool)
    allowed[cell[energy.label == labels[cell]]] = True
    return np.where(allowed, labels, BACKGROUND)


def _edge_sums(across: Labels, down: Labels) -> Labels:
    """Sum of each pixel's edges, quanta."""
    edge_sums = across + down
    edge_sums[:, 1:] += across[:, :-1]
    edge_sums[1:] += down[:-1]
    return edge_sums


@kernel
def _fill_costs(
    edges: Ints,
    first: Ints,
    share: Singles,
    background: Singles,
    foreground: Singles,
    detection: float,
    outlier_share: float,
    quantum: float,
    cost: Ints,
) -> None:
    """Fill the cost of each person at each pixel of the rectangle, relative to the background, quanta."""
    for j in range(len(edges)):
        i = first[j]
        for v in range(edges[j, 1], edges[j, 3]):
            for u in range(edges[j, 0], edges[j, 2]):
                likelihood = np.log((background[v, u] + outlier_share) / (share[i] + outlier_share))
                cost[i] = round((detection * (1.0 - 2.0 * foreground[v, u]) + likelihood) / quantum)
                i += 1


@kernel
def _count_labels(edges: Ints, cost: Ints, edge_sums: Labels, count: Ints) -> None:
    """Fill the number of admissible people at each pixel (v, u)."""
    i = 0
    for j in range(len(edges)):
        for v in range(edges[j, 1], edges[j, 3]):
            for u in range(edges[j, 0], edges[j, 2]):
                if cost[i] < edge_sums[v, u]:
                    count[v, u] += 1
                i += 1


@kernel
def _fill_labels(
    edges: Ints, cost: Ints, edge_sums: Labels, node: Ints, border: Ints, free: Ints, label: Ints, price: Ints
) -> None:  # fmt: skip
    """Fill the admissible labels of each pixel, ascending, and costs; `free` is each pixel's next free entry."""
    i = 0
    for j in range(len(edges)):
        for v in range(edges[j, 1], edges[j, 3]):
            for u in range(edges[j, 0], edges[j, 2]):
                if cost[i] < edge_sums[v, u]:
                    p = node[v, u]
                    label[free[p]], price[free[p]] = j + 1, cost[i] + border[p]
                    free[p] += 1
                i += 1


@kernel
def _fill_neighbours(
    node: Ints, across: Labels, down: Labels, start: Ints, end: Ints, weight: Ints, border: Ints
) -> int:  # fmt: skip
    """Fill the edges between nodes and the weights of edges to other pixels; number of edges."""
    edges_filled = 0
    rows, columns = node.shape
    for v in range(rows):
        for u in range(columns):
            for axis in range(2):
                to_v, to_u = v + axis, u + 1 - axis
                if to_v == rows or to_u == columns:
                    continue
                p, q = node[v, u], node[to_v, to_u]
                w = down[v, u] if axis == 1 else across[v, u]
                if p >= 0 and q >= 0:
                    if w > 0:
                        start[edges_filled], end[edges_filled], weight[edges_filled] = p, q, w
                        edges_filled += 1
                elif p >= 0:
                    border[p] += w
                elif q >= 0:
                    border[q] += w
    return edges_filled


_FARTHEST = 3 * 255**2


def adjacency(difference: Floats, config: LabelConfig) -> Floats:
    """Weights in nats at colour distances in grey levels, float64 of the same shape."""
    return config.boundary_weight * np.tanh((config.contrast_limit - difference) / (2 * config.contrast_slope)).clip(0)


def edge_costs(image: Bytes | None, shape: tuple[int, int], config: LabelConfig) -> tuple[Labels, Labels]:
    """Weights between each pixel and the next in its row, and between it and the one below.

    Parameters
    ----------
    image : uint8 (v, u, 3)
        None without colours: all pairs then have the mean weight at borders.
    shape
        Image size (v, u).

    Returns
    -------
    int32 (v, u), int32 (v, u)
        Quanta; 0 without a neighbour.
    """
    across, down = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    if image is None:
        across[:, :-1] = down[:-1] = round(config.boundary_weight * config.colourless_factor / QUANTUM)
    else:
        _fill_edge_costs(image, _table(config), across, down)
    return across, down


@lru_cache(maxsize=8)
def _table(config: LabelConfig) -> Labels:
    """Weights by squared distance, quanta."""
    costs = adjacency(np.sqrt(np.arange(_FARTHEST + 1)), config)
    return np.asarray(np.rint(costs / QUANTUM), np.int32)


@kernel
def _fill_edge_costs(image: Bytes, table: Labels, across: Labels, down: Labels) -> None:
    rows, columns, _ = image.shape
    for v in range(rows):
        for u in range(columns):
            if u + 1 < columns:
                across[v, u] = table[_square(image, v, u, v, u + 1)]
            if v + 1 < rows:
                down[v, u] = table[_square(image, v, u, v + 1, u)]


@kernel
def _square(image: Bytes, v: int, u: int, other_v: int, other_u: int) -> int:
    total = 0
    for channel in range(3):
        off = int(image[v, u, channel]) - int(image[other_v, other_u, channel])
        total += off * off
    return total
