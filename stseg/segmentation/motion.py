"""Where the cells near a person are in the next frame: the way that the edges in time follow."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Labels
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person


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
    near = nearest_person(grid.ground, start, reach)
    motion[near >= 0] = moved[near[near >= 0]][:, ::-1]
    return motion


def follow(motion: Ints) -> Labels:
    """Where each ground cell leads in the next frame, no two cells to the same.

    Where several claim a cell, one that moves wins over one that stands still: a body has come, and the floor that was
    there is gone. Of several that move, the first by y and x wins. Who loses, or leaves the grid, leads nowhere.

    Parameters
    ----------
    motion : int64 (time, y, x, 2)
        Cells (dy, dx) moved until the next frame.

    Returns
    -------
    int32 (time, y, x)
        y columns + x of the cell in the next frame, or -1.
    """
    rows, columns = motion.shape[1:3]
    to_y, to_x = np.arange(rows)[:, None] + motion[..., 0], np.arange(columns) + motion[..., 1]
    inside = (to_y >= 0) & (to_y < rows) & (to_x >= 0) & (to_x < columns)
    ahead = np.full(motion.shape[:3], -1, np.int32)
    for frame, here in enumerate(inside):
        claims = (to_y * columns + to_x)[frame][here]
        moving_first = np.argsort(~motion[frame][here].any(-1), kind="stable")
        to, claim = np.unique(claims[moving_first], return_index=True)
        ahead[frame].reshape(-1)[np.flatnonzero(here)[moving_first[claim]]] = to
    return ahead
