"""Distances between places of the ground."""

import numpy as np

from stseg.arrays import Floats, Ints


def distances(a: Floats, b: Floats) -> Floats:
    """Distances of every point (n, 2) from every other (m, 2), metres, float64 (n, m)."""
    return np.asarray(np.hypot(*np.moveaxis(a[:, None] - b[None], -1, 0)))


def unmatched(points: Floats, others: Floats, distance: float) -> Ints:
    """Rows of points (n, 2) that are not mutually nearest with one of others (m, 2) within metres, int64 (k,)."""
    between, rows = distances(points, others), np.arange(len(points))
    if not between.size:
        return rows
    nearest = between.argmin(1)
    return np.flatnonzero((between[rows, nearest] >= distance) | (between.argmin(0)[nearest] != rows))
