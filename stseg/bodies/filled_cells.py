"""Cells of the volume that standing people fill."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.bodies.pillars import PROFILE
from stseg.geometry.grid import Grid


def inside_bodies(grid: Grid, near_person: Ints, ground: Floats, height: Floats) -> Flags:
    """Cells that the pillar of the person near them fills, bool (plane, y, x).

    Parameters
    ----------
    near : int64 (y, x)
        The person near each cell, -1 for none.
    ground, height : float64 (person, 2), (person,)
        Metres.
    """
    inside = np.zeros(grid.shape, bool)
    within_reach = near_person >= 0
    person = near_person[within_reach]
    distance = np.hypot(*(grid.ground[within_reach] - ground[person]).T)
    for plane, above in zip(inside, grid.heights, strict=True):
        plane[within_reach] = distance <= np.interp(above / height[person], PROFILE[:, 0], PROFILE[:, 1], right=-1.0)
    return inside
