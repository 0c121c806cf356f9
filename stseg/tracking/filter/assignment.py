"""One-to-one assignment of least cost."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Floats, Ints


def assign(cost: Floats, alone: float) -> tuple[Ints, Ints]:
    """Pairs of least total cost, where an unassigned pair costs `alone`; rows and columns, both int64."""
    gain = np.minimum(cost - alone, 0.0)
    rows, columns = linear_sum_assignment(gain)
    kept = gain[rows, columns] < 0
    return rows[kept], columns[kept]
