"""Distances between places of the ground."""

import numpy as np

from stseg.arrays import Floats


def distances(a: Floats, b: Floats) -> Floats:
    """Distances of every point (n, 2) from every other (m, 2), metres, float64 (n, m)."""
    return np.asarray(np.hypot(*np.moveaxis(a[:, None] - b[None], -1, 0)))
