"""Where the cells near a person are in the next frame: the way that the edges in time follow."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.geometry import Grid
from stseg.geometry.near import near_person


def motion_field(
    ground_now: Floats, ground_next: Floats, chain_now: Ints, chain_next: Ints, reach: float, grid: Grid
) -> Ints:
    """Motion of each cell until the next frame, in cells.

    Parameters
    ----------
    ground_now, ground_next : float64 (n, 2), (m, 2)
        People of the two frames, metres.
    chain_now, chain_next : int64 (n,), (m,)
        Who they are: equal numbers are the same body.
    reach
        How far from a person's place their cells reach, metres.

    Returns
    -------
    int64 (y, x, 2)
        (dy, dx); zero where nobody is near, or whoever is was not found again.
    """
    motion = np.zeros((*grid.shape[1:], 2), np.int64)
    _, now, then = np.intersect1d(chain_now, chain_next, return_indices=True)
    if not len(now):
        return motion
    start = ground_now[now]
    moved = np.rint((ground_next[then] - start) / grid.cell).astype(np.int64)
    near = near_person(grid.ground, start, reach)
    motion[near >= 0] = moved[near[near >= 0]][:, ::-1]
    return motion
