"""Implicit neighbourhood of a space-time grid: node numbers with guards, neighbours by addition."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import part
from stseg.arrays import AnyArray, Ints, Labels


class Lattice(NamedTuple):
    """Numbering of the nodes of a grid (time, plane, y, x), and the ends of their arcs.

    The first plane of a frame, the first row of a plane and the first cell of a row are guards, not cells: an arc off
    the grid ends at one of them.

    Attributes
    ----------
    steps : int32 (degree,)
        Difference of node numbers along each arc within a frame; slots 2 i and 2 i + 1 are opposite.
    forward, behind : int32 (node,)
        Difference of node numbers to the successor in the next frame and to the predecessor; 0 for none.
    spatial
        Number of arc slots within a frame; those after it lead to the next (even) and previous frame (odd).
    frame
        Number of nodes of a frame, guards included.
    """

    steps: Labels
    forward: Labels
    backward: Labels
    spatial: int
    frame: int


def lattice_of(shape: tuple[int, ...], offsets: Ints, successor: Labels) -> Lattice:
    """Lattice of a grid of some shape (time, plane, y, x) with the neighbours of `stseg.graphcut.energy.Energy`."""
    frames, planes, rows, columns = shape
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    frame = (planes + 1) * plane
    step = offsets[:, 1:] @ (plane, row, 1)
    spatial = int((offsets[:, 0] == 0).sum())
    time, y, x = np.nonzero(successor >= 0)
    to_y, to_x = np.divmod(successor[time, y, x], columns)
    step_in_time = frame + (to_y - y) * row + to_x - x
    to_next, to_previous = (np.zeros((frames, 1, rows, columns), np.int32) for _ in range(2))
    to_next[time, 0, y, x] = step_in_time
    to_previous[time + 1, 0, to_y, to_x] = -step_in_time
    forward, backward = (spread(np.broadcast_to(table, shape)) for table in (to_next, to_previous))
    return Lattice(np.stack([step, -step], 1).ravel().astype(np.int32), forward, backward, 2 * spatial, frame)


def spread(volume: AnyArray) -> AnyArray:
    """Values of cells (time, plane, y, x) at their nodes, 0 at guards; (node,)."""
    frames, planes, rows, columns = volume.shape
    # Guards behind the last frame, as far as the last cell's neighbours reach.
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    nodes = np.zeros(frames * (planes + 1) * plane + plane + row + 1, volume.dtype)
    cells(nodes, volume.shape)[:] = volume
    return nodes


def cells(nodes: AnyArray, shape: tuple[int, ...]) -> AnyArray:
    """View of node values as cells (time, plane, y, x), without guards."""
    frames, planes, rows, columns = shape
    guarded = (frames, planes + 1, rows + 1, columns + 1)
    return nodes[: np.prod(guarded)].reshape(guarded)[:, 1:, 1:, 1:]


@part
def neighbour(node: int, slot: int, lattice: Lattice) -> int:
    """Node at the end of an arc; 0, a guard, for an arc in time without an end."""
    to = node + int(lattice.steps[slot])
    if slot < lattice.spatial:
        return to
    if slot & 1:
        step_in_time = int(lattice.backward[to])
        return to + step_in_time if step_in_time != 0 else 0
    step_in_time = int(lattice.forward[node])
    return to + step_in_time if step_in_time != 0 else 0
