"""One-to-one assignment of least cost."""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.linear_assignment import fill_assignment_of_least_cost


def assign(cost: Floats, alone: float) -> tuple[Ints, Ints]:
    """Pairs of least total cost, where an unassigned pair costs `alone`; rows and columns, both int64."""
    if not cost.size:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    gain = np.minimum(cost - alone, 0.0)
    turned = gain.shape[0] > gain.shape[1]
    rows, columns = np.arange(min(gain.shape)), np.zeros(min(gain.shape), np.int64)
    fill_assignment_of_least_cost(np.ascontiguousarray(gain.T if turned else gain), columns)
    if turned:
        rows = np.argsort(columns)
        rows, columns = columns[rows], rows
    kept = gain[rows, columns] < 0
    return rows[kept], columns[kept]
