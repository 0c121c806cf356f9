"""Labels of ground cells and measures of blobs in plain NumPy."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints, Labels, Singles
from stseg.geometry import Grid
from stseg.segmentation.blob_measures import BlobMeasures

_FAINT = 1e-6


def ground_labels(label: Labels, log_odds: Singles) -> Labels:
    """Label with the most mass above each ground cell, int32 (y, x); 0 for none."""
    labels = np.unique(label[label != 0])
    ground_label, most = np.zeros(label.shape[1:], np.int32), np.zeros(label.shape[1:])
    strength = np.nan_to_num(log_odds).clip(0) + _FAINT
    for track_id in labels:
        mass = np.where(label == track_id, strength, 0.0).sum(0)
        ground_label[mass > most] = track_id
        np.maximum(most, mass, out=most)
    return ground_label


def measures(cells: Labels, track: Ints, label: Labels, log_odds: Singles, grid: Grid) -> BlobMeasures:
    """BlobMeasures of blobs; see `stseg.segmentation.blob_measures`."""
    n, cell_ground = len(track), grid.ground
    occupied = label == np.append(0, track)[cells]
    occupied &= label != 0
    strength = np.where(occupied, np.nan_to_num(log_odds), 0.0)
    weight = strength.clip(0).sum(0) + _FAINT
    ground, covariance = np.zeros((n, 2)), np.zeros((n, 2, 2))
    count, height, mass = np.zeros(n), np.zeros(n), np.zeros(n)
    for b in range(n):
        inside = cells == b + 1
        share = weight[inside] / weight[inside].sum()
        blob_ground = cell_ground[inside]
        ground[b] = share @ blob_ground
        spread = blob_ground - ground[b]
        covariance[b] = (spread * share[:, None]).T @ spread / max(inside.sum(), 1)
        count[b] = inside.sum()
        planes = occupied[:, inside].any(1)
        height[b] = grid.heights[np.flatnonzero(planes)[-1]]
        mass[b] = strength[:, inside].sum() / max(occupied[:, inside].sum(), 1)
    return BlobMeasures(ground, covariance, count, height, mass)
