"""One-to-one assignment of greatest gain, for kernels: shortest augmenting paths (Jonker and Volgenant 1987).

`scipy.optimize.linear_sum_assignment` does the same outside kernels.
"""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel


@kernel
def fill_assignment_of_least_cost(cost: Floats, column_of: Ints) -> None:
    """Fill column_of (n,) with a distinct column for each row of cost (n, m), n <= m, at the least total cost."""
    rows, columns = cost.shape
    row_price, column_price = np.zeros(rows + 1), np.zeros(columns + 1)
    row_of, before = np.zeros(columns + 1, np.int64), np.zeros(columns + 1, np.int64)
    distance, reached = np.empty(columns + 1), np.empty(columns + 1, np.bool_)
    for i in range(1, rows + 1):
        row_of[0] = i
        here = 0
        distance[:] = np.inf
        reached[:] = False
        while row_of[here] != 0:
            reached[here] = True
            row, step, nearest = row_of[here], np.inf, 0
            for j in range(1, columns + 1):
                if not reached[j]:
                    length = cost[row - 1, j - 1] - row_price[row] - column_price[j]
                    if length < distance[j]:
                        distance[j], before[j] = length, here
                    if distance[j] < step:
                        step, nearest = distance[j], j
            for j in range(columns + 1):
                if reached[j]:
                    row_price[row_of[j]] += step
                    column_price[j] -= step
                else:
                    distance[j] -= step
            here = nearest
        while here != 0:
            row_of[here] = row_of[before[here]]
            here = before[here]
    for j in range(1, columns + 1):
        if row_of[j] > 0:
            column_of[row_of[j] - 1] = j - 1
