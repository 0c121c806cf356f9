"""Motion field of ground cells, along which edges in time run."""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints, Labels
from stseg.geometry.nearest_person import nearest_person
from stseg.kernels.accelerate import kernel


def same_tracks(one: Ints, other: Ints) -> tuple[Ints, Ints]:
    """Where tracks that two frames share stand in each, by rising track; a frame has each but once."""
    first, second = np.nonzero(one[:, None] == other)
    order = np.argsort(one[first])
    return first[order], second[order]


class PlacedTracks(NamedTuple):
    """Detections of a frame: places float64 (n, 2), metres, and their tracks int64 (n,)."""

    ground: Floats
    track: Ints


def motion_field(now: PlacedTracks, then: PlacedTracks, reach: float, cell: float, ground: Floats) -> Ints:
    """Motion of each cell until the next frame, (dy, dx) in cells, int64 (y, x, 2).

    It is zero out of reach of tracks detected in both frames, `now` and `then`. `reach` is that of a body's cells
    around its place, `cell` the side of a cell, and `ground` float64 (y, x, 2) the centres of the cells, all in metres.
    """
    motion = np.zeros(ground.shape, np.int64)
    first, second = same_tracks(now.track, then.track)
    if not len(first):
        return motion
    start = now.ground[first]
    moved = np.rint((then.ground[second] - start) / cell).astype(np.int64)
    nearest = nearest_person(ground, start, reach)
    motion[nearest >= 0] = moved[nearest[nearest >= 0]][:, ::-1]
    return motion


def successor_cells(motion: Ints) -> Labels:
    """Injective map of ground cells to those of the next frame, int32 (time, y, x): y columns + x of that cell, or -1.

    `motion` int64 (time, y, x, 2) is (dy, dx), in cells, until the next frame. Of several cells with the same target a
    moving one wins over a still one: a body covers the floor. Of several moving ones the first by y and x wins. Losers,
    and cells that leave the grid, have no successor.
    """
    successor = np.full(motion.shape[:3], -1, np.int32)
    _fill_successors(motion, successor)
    return successor


@kernel
def _fill_successors(motion: Ints, successor: Labels) -> None:
    """Fill successor (time, y, x), which holds -1; moving cells claim theirs before still ones."""
    frames, rows, columns = successor.shape
    claimed = np.empty((rows, columns), np.bool_)
    for t in range(frames):
        claimed[:] = False
        for moving in (True, False):
            for y in range(rows):
                for x in range(columns):
                    down, right = motion[t, y, x, 0], motion[t, y, x, 1]
                    to_y, to_x = y + down, x + right
                    inside = 0 <= to_y < rows and 0 <= to_x < columns
                    if moving == (down != 0 or right != 0) and inside and not claimed[to_y, to_x]:
                        claimed[to_y, to_x] = True
                        successor[t, y, x] = to_y * columns + to_x
