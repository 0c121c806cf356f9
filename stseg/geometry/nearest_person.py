"""Assignment of ground places to the nearest person."""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel


def nearest_person(ground: Floats, people_ground: Floats, reach: float) -> Ints:
    """Index of the nearest person within reach of each place, -1 if none.

    Parameters
    ----------
    ground : float64 (..., 2)
        Places, metres.
    people_ground : float64 (n, 2)
        People, metres.

    Returns
    -------
    int64 (...)
    """
    nearest = np.empty(ground.shape[:-1], np.int64)
    low, high = people_ground.min(0, initial=np.inf), people_ground.max(0, initial=-np.inf)
    around = np.concatenate([low - 2 * reach, high + 2 * reach])  # rounding decides nothing there
    _fill_nearest(np.ascontiguousarray(ground.reshape(-1, 2)), people_ground, reach, around, nearest.reshape(-1))
    return nearest


@kernel
def _fill_nearest(ground: Floats, people_ground: Floats, reach: float, around: Floats, nearest: Ints) -> None:
    """Fill nearest (place,); the rectangle around all people is asked first, then the square of the reach."""
    left, low, right, high = around
    nearest[:] = -1
    for c in range(len(ground)):
        if ground[c, 0] < left or ground[c, 0] > right or ground[c, 1] < low or ground[c, 1] > high:
            continue
        least = np.inf
        for j in range(len(people_ground)):
            x, y = ground[c, 0] - people_ground[j, 0], ground[c, 1] - people_ground[j, 1]
            if abs(x) <= reach and abs(y) <= reach:
                away = np.hypot(x, y)
                if away <= reach and away < least:
                    least, nearest[c] = away, j
