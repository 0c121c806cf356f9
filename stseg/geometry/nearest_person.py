"""Assignment of ground places to the nearest person."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints


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
    if not len(people_ground):
        return np.full(ground.shape[:-1], -1, np.int64)
    away = np.hypot(*np.moveaxis(ground[..., None, :] - people_ground, -1, 0))
    return np.where(away.min(-1) <= reach, away.argmin(-1), -1)
