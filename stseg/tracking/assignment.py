"""One-to-one assignment of least cost (Hungarian method, SciPy)."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Floats, Ints


def assign(cost: Floats, alone: float) -> tuple[Ints, Ints]:
    """Pairs of least total cost, where an unassigned pair costs `alone`; rows and columns, both int64."""
    if not cost.size:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    gain = np.minimum(cost - alone, 0.0)
    rows, columns = linear_sum_assignment(gain)
    kept = gain[rows, columns] < 0
    return rows[kept], columns[kept]


def distances(a: Floats, b: Floats) -> Floats:
    """Distances of every point (n, 2) from every other (m, 2), metres, float64 (n, m)."""
    return np.asarray(np.hypot(*np.moveaxis(a[:, None] - b[None], -1, 0)))
