"""Kernels of blobs: the label of each ground cell, the nearest cell of a person's track, and centroids."""

import numpy as np

from stseg.arrays import Floats, Ints, Labels, Singles
from stseg.kernels.accelerate import kernel, part

_FAINT = np.float32(1e-6)
"""Mass of a cell without evidence, nats."""
_ZERO = np.float32(0)


@part
def _strength(log_odds: np.float32) -> np.float32:
    """Log-odds of a cell, 0 where no view sees it."""
    return _ZERO if np.isnan(log_odds) else log_odds


@kernel
def fill_ground_labels(label: Labels, log_odds: Singles, ground_label: Labels) -> None:
    """Fill ground_label (y, x), 0 everywhere before, with the label that has the most mass above each ground cell.

    Of labels (plane, y, x) with the same mass the least is taken.
    """
    planes, rows, columns = label.shape
    for y in range(rows):
        for x in range(columns):
            most = _ZERO
            for z in range(planes):
                candidate = label[z, y, x]
                if candidate == 0 or candidate == ground_label[y, x]:
                    continue
                mass = _ZERO
                for k in range(planes):
                    if label[k, y, x] == candidate:
                        strength = _strength(log_odds[k, y, x])
                        mass += (strength if strength > _ZERO else _ZERO) + _FAINT
                if mass > most or (mass == most and candidate < ground_label[y, x]):
                    ground_label[y, x], most = candidate, mass


@kernel
def fill_nearest(
    ground_label: Labels, people_ground: Floats, people_track: Ints, ground: Floats, nearest: Floats
) -> None:
    """Fill nearest (person,) with the distance to the nearest cell that has the person's track, metres; inf for none.

    Ground (y, x, 2) are the cells' centres, metres.
    """
    nearest[:] = np.inf
    for y in range(ground.shape[0]):
        for x in range(ground.shape[1]):
            if ground_label[y, x] > 0:
                for j in range(len(people_track)):
                    if people_track[j] == ground_label[y, x]:
                        away = np.hypot(ground[y, x, 0] - people_ground[j, 0], ground[y, x, 1] - people_ground[j, 1])
                        nearest[j] = min(nearest[j], away)


@kernel
def fill_centroids(
    cells: Labels, track: Ints, label: Labels, log_odds: Singles, ground: Floats, centroid: Floats
) -> bool:
    """Fill centroid (n, 2), 0 before, with that of each blob's mass, metres; whether two blobs are beside each other.

    `cells` int32 (y, x) is the blob of each ground cell, counted from 1, 0 for none; `track` int64 (n,) the label of
    the cells of each blob. `label` int32 and `log_odds` float32 (plane, y, x), nats, are of each cell, and `ground`
    float64 (y, x, 2) in metres.
    """
    total, meet = np.zeros(len(track)), False
    for y in range(cells.shape[0]):
        for x in range(cells.shape[1]):
            if cells[y, x] > 0:
                b, weight = cells[y, x] - 1, float(_FAINT)
                meet = meet or _is_beside_another(cells, y, x)
                for z in range(len(label)):
                    if label[z, y, x] == track[b]:
                        weight += float(max(_strength(log_odds[z, y, x]), _ZERO))
                total[b] += weight
                centroid[b, 0] += weight * ground[y, x, 0]
                centroid[b, 1] += weight * ground[y, x, 1]
    for b in range(len(track)):
        centroid[b, 0] /= total[b]
        centroid[b, 1] /= total[b]
    return meet


@part
def _is_beside_another(cells: Labels, y: int, x: int) -> bool:
    """Whether one of the four neighbours before a blob's cell, of all eight, is of another blob."""
    for down, right in ((-1, -1), (-1, 0), (-1, 1), (0, -1)):
        if y + down >= 0 and 0 <= x + right < cells.shape[1]:
            other = cells[y + down, x + right]
            if other > 0 and other != cells[y, x]:
                return True
    return False
