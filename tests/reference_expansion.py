"""Slow plain definitions of the many-label energy and its moves, with nothing of the code that they judge."""

from collections.abc import Iterator
from itertools import product

import maxflow
import numpy as np

from stseg.arrays import Floats, Ints
from stseg.graphcut.expansion import LabelEnergy
from stseg.records.predicted_tracks import PredictedPlaces
from stseg.segmentation.label_energy import BodyShape


def costs(energy: LabelEnergy) -> list[dict[int, int]]:
    """For each cell what each of its labels costs."""
    own = [{0: 0} for _ in range(energy.cells)]
    for p in range(energy.cells):
        for i in range(energy.first[p], energy.first[p + 1]):
            own[p][int(energy.label[i])] = int(energy.cost[i])
    return own


def energy_of(energy: LabelEnergy, labels: Ints) -> int:
    """Term by term."""
    total = sum(own[int(label)] for own, label in zip(costs(energy), labels, strict=True))
    for p, q, w in zip(energy.start, energy.end, energy.weight, strict=True):
        total += int(w) * int(labels[p] != labels[q])
    return total


def expansions(energy: LabelEnergy, labels: Ints, alpha: int) -> Iterator[Ints]:
    """Every labelling that one expansion of alpha can reach, the fewest cells first."""
    may = [p for p, own in enumerate(costs(energy)) if alpha in own and labels[p] != alpha]
    for taken in sorted(product((False, True), repeat=len(may)), key=sum):
        moved = labels.copy()
        moved[[p for p, takes in zip(may, taken, strict=True) if takes]] = alpha
        yield moved


def plain_expand(energy: LabelEnergy, labels: Ints) -> Ints:
    """Every move a cut of all cells by another solver; Kolmogorov and Zabih's construction, nothing left out."""
    own = costs(energy)
    labels, before = labels.copy(), None
    while before is None or energy_of(energy, labels) < before:
        before = energy_of(energy, labels)
        for alpha in sorted({0, *energy.label.tolist()}):
            labels = _plain_move(energy, own, labels, alpha)
    return labels


def _plain_move(energy: LabelEnergy, own: list[dict[int, int]], labels: Ints, alpha: int) -> Ints:
    never = 1 + sum(abs(cost) for costs in own for cost in costs.values()) + 2 * int(energy.weight.sum())
    graph = maxflow.GraphInt(energy.cells, len(energy.start))
    graph.add_nodes(energy.cells)
    for p, costs_of in enumerate(own):  # on the sink's side are those that have alpha afterwards
        stays = never if labels[p] == alpha else costs_of[int(labels[p])]
        takes = costs_of.get(alpha, never)
        graph.add_tedge(p, takes - min(stays, takes), stays - min(stays, takes))
    for p, q, w in zip(energy.start.tolist(), energy.end.tolist(), energy.weight.tolist(), strict=True):
        # Pays a where neither takes alpha, b where only q does, c where only p does.
        a, b, c = (w * int(x != y) for x, y in ((labels[p], labels[q]), (labels[p], alpha), (alpha, labels[q])))
        graph.add_tedge(p, max(c - a, 0), max(a - c, 0))
        graph.add_tedge(q, max(-c, 0), max(c, 0))
        graph.add_edge(p, q, b + c - a, 0)
    graph.maxflow()
    return np.array([alpha if graph.get_segment(p) else labels[p] for p in range(energy.cells)])


def share(frame: int, ground: Floats, height: float, predicted: PredictedPlaces, body: BodyShape) -> Floats:
    """Of one cell, as the formula reads; nothing is out of reach."""
    disc = np.eye(2) * body.reach**2 / 4
    weights = []
    for k in range(len(predicted.track)):
        off, spread = ground - predicted.ground[frame, k], predicted.covariance[frame, k] + disc
        density = np.exp(-0.5 * off @ np.linalg.solve(spread, off)) / np.sqrt(np.linalg.det(spread))
        above = max(height - predicted.height[frame, k], 0.0)
        weight = density * np.sqrt(np.linalg.det(disc)) * np.exp(-0.5 * (above / body.height_spread) ** 2)
        weights.append(weight if predicted.expected[frame, k] else 0.0)
    weights.append(body.prior_share)
    return np.array(weights) / sum(weights)
