"""Energy of the pixel labels of one view (Huang and Wang 2012, eq. 22 with statuses given).

    E(l) = sum_p [ c1 (q_p [l_p = 0] + (1 - q_p) [l_p > 0]) - log p(l_p | S) - a_p(l_p) ] + sum_(p,q) w_pq [l_p != l_q]

a is the log-ratio of colours (`colour_ratios`), 0 without. q is the foreground probability of a person,
where the paper has 0 or 1 (eqs 13 to 15). Costs are relative to the background, pixel by pixel. A label that costs a
pixel more than the sum of its edges is in no minimum, so only pixels in and around people are nodes.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Singles
from stseg.config import LabelConfig
from stseg.graphcut.expansion import BACKGROUND, LabelEnergy
from stseg.graphcut.grid_energy import QUANTUM
from stseg.kernels.accelerate import kernel
from stseg.pixel_labels.label_likelihood import LabelLikelihood, PersonPatches


@dataclass(frozen=True)
class PixelEnergy:
    """Pixels with admissible labels, and the energy of their labels."""

    pixel: Ints
    """int64 (n,): indices in the flattened window, ascending."""
    energy: LabelEnergy
    """Label j + 1 is person j."""


def pixel_energy(
    prior: LabelLikelihood,
    foreground: Singles,
    across: Labels,
    down: Labels,
    config: LabelConfig,
    colour: Singles | None = None,
) -> PixelEnergy:
    """Energy of an image window, which the label likelihood `prior` defines.

    `foreground` float32 (v, u) is q in the window, `across` and `down` int32 (v, u) are w to the next pixel in the row
    and in the column, quanta, and `colour` float32 (m,) is a of each person at the pixels of the rectangle, nats; None
    without colours.
    """
    people, edge_sums = prior.people, _edge_sums(across, down)
    cost, outliers = np.empty(len(people.share), np.int64), config.outlier_rate / (len(people.edges) + 1)
    _fill_costs(people, (prior.left, prior.top), prior.background, foreground, config.foreground_weight, outliers, cost)
    if colour is not None:
        cost -= np.rint(colour / QUANTUM).astype(np.int64)
    rectangles = people.rectangles((prior.left, prior.top))
    costs = [cost[values].reshape(edge_sums[here].shape) for here, values in rectangles]
    allowed = [cost_of < edge_sums[here] for cost_of, (here, _) in zip(costs, rectangles, strict=True)]
    count, node = np.zeros(foreground.shape, np.int64), np.full(foreground.shape, -1, np.int64)
    for labelled, (here, _) in zip(allowed, rectangles, strict=True):
        count[here] += labelled
    pixel = np.flatnonzero(count)
    node.flat[pixel] = np.arange(len(pixel))
    first = np.append(0, np.cumsum(count.flat[pixel]))
    start, end, weight, border = _neighbours(node, len(pixel), across, down)
    label, price = np.empty((2, first[-1]), np.int64)
    free = first[:-1].copy()  # the next entry of each pixel
    for j, (cost_of, labelled, (here, _)) in enumerate(zip(costs, allowed, rectangles, strict=True)):
        p = node[here][labelled]
        label[free[p]], price[free[p]] = j + 1, cost_of[labelled] + border[p]
        free[p] += 1
    return PixelEnergy(pixel, LabelEnergy(first, label, price, start, end, weight))


def most_likely_labels(prior: LabelLikelihood) -> Ints:
    """Label of greatest likelihood at each pixel of the window (eq. 24), int64 (v, u)."""
    best, label = prior.background.copy(), np.zeros(prior.background.shape, np.int64)
    for j, (here, values) in enumerate(prior.people.rectangles((prior.left, prior.top))):
        share = prior.people.share[values].reshape(best[here].shape)
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
    people: PersonPatches,
    corner: tuple[int, int],
    background: Singles,
    foreground: Singles,
    detection: float,
    outlier_share: float,
    cost: Ints,
) -> None:
    """Fill the cost of each person at each pixel of the rectangle, relative to the background, quanta."""
    (left, top), edges = corner, people.edges
    for j in range(len(edges)):
        i = people.first[j]
        for v in range(edges[j, 1] - top, edges[j, 3] - top):
            for u in range(edges[j, 0] - left, edges[j, 2] - left):
                likelihood = np.log((background[v, u] + outlier_share) / (people.share[i] + outlier_share))
                cost[i] = round((detection * (1.0 - 2.0 * foreground[v, u]) + likelihood) / QUANTUM)
                i += 1


_FARTHEST = 3 * 255**2


def adjacency(difference: Floats, config: LabelConfig) -> Floats:
    """Weights in nats at colour distances in grey levels, float64 of the same shape."""
    return config.boundary_weight * np.tanh((config.contrast_limit - difference) / (2 * config.contrast_slope)).clip(0)


def edge_costs(image: Bytes | None, shape: tuple[int, int], config: LabelConfig) -> tuple[Labels, Labels]:
    """Weights between each pixel and the next in its row, and between it and the one below.

    Both int32 (v, u), quanta; 0 without a neighbour. `image` is uint8 (v, u, 3), of the size `shape` (v, u), or None
    without colours: all pairs then have the mean weight at borders.
    """
    across, down = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    if image is None:
        across[:, :-1] = down[:-1] = round(config.boundary_weight * config.colourless_factor / QUANTUM)
    else:
        table = _table(config)
        across[:, :-1] = table[_squared_distance(image[:, 1:], image[:, :-1])]
        down[:-1] = table[_squared_distance(image[1:], image[:-1])]
    return across, down


def _squared_distance(one: Bytes, other: Bytes) -> Labels:
    """Squared distance of colours (v, u, 3), int32 (v, u)."""
    return np.asarray(np.square(one.astype(np.int32) - other).sum(-1, dtype=np.int32))


@lru_cache(maxsize=8)
def _table(config: LabelConfig) -> Labels:
    """Weights by squared distance, quanta."""
    costs = adjacency(np.sqrt(np.arange(_FARTHEST + 1)), config)
    return np.asarray(np.rint(costs / QUANTUM), np.int32)


def _neighbours(node: Ints, nodes: int, across: Labels, down: Labels) -> tuple[Ints, Ints, Ints, Ints]:
    """Edges between nodes: start, end and weight, int64 (edge,); and each node's weights to other pixels, (node,)."""
    neighbour = np.full((*node.shape, 2), -1, np.int64)
    neighbour[:, :-1, 0], neighbour[:-1, :, 1] = node[:, 1:], node[1:]
    weight, pixel = np.stack([across, down], -1).astype(np.int64), np.broadcast_to(node[..., None], neighbour.shape)
    joined, border = (pixel >= 0) & (neighbour >= 0) & (weight > 0), np.zeros(nodes, np.int64)
    for one, other in ((pixel, neighbour), (neighbour, pixel)):
        outside = (one >= 0) & (other < 0)
        np.add.at(border, one[outside], weight[outside])
    return pixel[joined], neighbour[joined], weight[joined], border
