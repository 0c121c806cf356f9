"""Pairs of people who stand near each other in one frame, found at once in all frames of a run."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Rows


def near_rows(trajectory: Rows, distance: float) -> tuple[Ints, Floats]:
    """Pairs of rows of one frame less than a distance apart, metres; the trajectory, TRAJECTORY (n,), is in any order.

    Returns the rows of each pair, int64 (k, 2), that of the lower id first, and their distances, float64 (k,), in no
    order.
    """
    order = np.lexsort((trajectory["id"], trajectory["frame"]))
    frame, x, y = (trajectory[name][order] for name in ("frame", "x", "y"))
    pairs, distances = [np.zeros((0, 2), np.int64)], [np.zeros(0)]
    for step in range(1, len(order)):
        same = frame[step:] == frame[:-step]
        if not same.any():
            break
        away = np.hypot(x[step:] - x[:-step], y[step:] - y[:-step])
        pair = np.flatnonzero(same & (away < distance))
        pairs.append(np.column_stack([order[pair], order[pair + step]]))
        distances.append(away[pair])
    return np.concatenate(pairs), np.concatenate(distances)
