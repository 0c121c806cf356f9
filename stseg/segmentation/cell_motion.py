"""Motion field of ground cells, along which edges in time run."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Labels
from stseg.geometry import Grid
from stseg.geometry.nearest_person import nearest_person


def motion_field(
    ground_now: Floats, ground_next: Floats, track_now: Ints, track_next: Ints, reach: float, grid: Grid
) -> Ints:
    """Motion of each cell until the next frame, in cells.

    Parameters
    ----------
    ground_now, ground_next : float64 (n, 2), (m, 2)
        Detections of the two frames, metres.
    track_now, track_next : int64 (n,), (m,)
        Their tracks.
    reach
        Reach of a body's cells around its place, metres.

    Returns
    -------
    int64 (y, x, 2)
        (dy, dx); zero out of reach of tracks detected in both frames.
    """
    motion = np.zeros((*grid.shape[1:], 2), np.int64)
    _, now, later = np.intersect1d(track_now, track_next, return_indices=True)
    if not len(now):
        return motion
    start = ground_now[now]
    moved = np.rint((ground_next[later] - start) / grid.cell).astype(np.int64)
    near = nearest_person(grid.ground, start, reach)
    motion[near >= 0] = moved[near[near >= 0]][:, ::-1]
    return motion


def successor_cells(motion: Ints) -> Labels:
    """Injective map of ground cells to those of the next frame.

    Of several cells with the same target a moving one wins over a still one: a body covers the floor. Of several moving
    ones the first by y and x wins. Losers, and cells that leave the grid, have no successor.

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
    successor = np.full(motion.shape[:3], -1, np.int32)
    for frame, inside_now in enumerate(inside):
        target = (to_y * columns + to_x)[frame][inside_now]
        moving_first = np.argsort(~motion[frame][inside_now].any(-1), kind="stable")
        to, first_claim = np.unique(target[moving_first], return_index=True)
        successor[frame].reshape(-1)[np.flatnonzero(inside_now)[moving_first[first_claim]]] = to
    return successor
