"""How the cells of a window are numbered, and which numbers are neighbours: nothing of it is stored per cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import part
from stseg.arrays import AnyArray, Labels
from stseg.graphcut.energy import Energy


class Lattice(NamedTuple):
    """How nodes of a window are numbered, and where their arcs lead.

    The first plane of a frame, the first row of a plane and the first cell of a row are guards and no cells: whoever
    steps off the grid lands on one of them, at either end.

    Attributes
    ----------
    steps : int32 (degree,)
        What each arc adds to a node's number within a frame; arcs lead back in pairs 2 i, 2 i + 1.
    ahead, behind : int32 (node,)
        What following the body's motion adds to a node's number, to the next frame and to the one before; 0 where it
        leads nowhere.
    near
        Arcs within a frame; those after it lead ahead (even) and behind (odd).
    frame
        Nodes of a frame, guards included.
    """

    steps: Labels
    ahead: Labels
    behind: Labels
    near: int
    frame: int


def lay_out(energy: Energy) -> Lattice:
    """The lattice of a window."""
    frames, planes, rows, columns = energy.unary.shape
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    frame = (planes + 1) * plane
    step = energy.offsets[:, 1:] @ (plane, row, 1)
    near = int((energy.offsets[:, 0] == 0).sum())
    time, y, x = np.nonzero(energy.ahead >= 0)
    to_y, to_x = np.divmod(energy.ahead[time, y, x], columns)
    leap = frame + (to_y - y) * row + to_x - x
    there, back = (np.zeros((frames, 1, rows, columns), np.int32) for _ in range(2))
    there[time, 0, y, x] = leap
    back[time + 1, 0, to_y, to_x] = -leap
    ahead, behind = (spread(np.broadcast_to(table, energy.unary.shape)) for table in (there, back))
    return Lattice(np.stack([step, -step], 1).ravel().astype(np.int32), ahead, behind, 2 * near, frame)


def spread(volume: AnyArray) -> AnyArray:
    """Values of the cells (time, plane, y, x) at their nodes, and 0 at the guards; (node,)."""
    frames, planes, rows, columns = volume.shape
    # Behind the last frame there are as many guards as the last cell's neighbours reach.
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    nodes = np.zeros(frames * (planes + 1) * plane + plane + row + 1, volume.dtype)
    cells(nodes, volume.shape)[:] = volume
    return nodes


def cells(nodes: AnyArray, shape: tuple[int, ...]) -> AnyArray:
    """Values of the nodes as a volume (time, plane, y, x), without the guards: a view."""
    frames, planes, rows, columns = shape
    guarded = (frames, planes + 1, rows + 1, columns + 1)
    return nodes[: np.prod(guarded)].reshape(guarded)[:, 1:, 1:, 1:]


@part
def neighbour(node: int, slot: int, lattice: Lattice) -> int:
    """The node that an arc leads to; 0, a guard, for an arc in time that leads nowhere."""
    to = node + int(lattice.steps[slot])
    if slot < lattice.near:
        return to
    if slot & 1:
        leap = int(lattice.behind[to])
        return to + leap if leap != 0 else 0
    leap = int(lattice.ahead[node])
    return to + leap if leap != 0 else 0
