"""Implicit neighbourhood of a space-time grid: node numbers with guards, neighbours by addition."""

from typing import NamedTuple

import numpy as np

from stseg.arrays import AnyArray, Ints, Labels
from stseg.kernels.accelerate import kernel, part


class Lattice(NamedTuple):
    """Numbering of the nodes of a grid (time, plane, y, x), and the ends of their arcs.

    The first plane of a frame, the first row of a plane and the first cell of a row are guards, not cells: an arc off
    the grid ends at one of them.
    """

    steps: Labels
    """int32 (degree,): difference of node numbers along each arc within a frame; slots 2 i and 2 i + 1 are opposite."""
    forward: Labels
    backward: Labels
    """int32 (node,) each: difference of node numbers to the successor in the next frame and to the predecessor; 0 for
    none."""
    spatial: int
    """Number of arc slots within a frame; those after it lead to the next (even) and previous frame (odd)."""
    frame: int
    """Number of nodes of a frame, guards included."""


def lattice_of(shape: tuple[int, ...], offsets: Ints, successor: Labels) -> Lattice:
    """Lattice of a grid (time, plane, y, x) with the neighbours of a `stseg.graphcut.grid_energy.GridEnergy`."""
    _, planes, rows, columns = shape
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    step = offsets[:, 1:] @ (plane, row, 1)
    steps, spatial = np.stack([step, -step], 1).ravel().astype(np.int32), 2 * int((offsets[:, 0] == 0).sum())
    forward, backward = np.zeros((2, _number(shape)), np.int32)
    _fill_steps(successor, planes, forward, backward)
    return Lattice(steps, forward, backward, spatial, (planes + 1) * plane)


@kernel
def _fill_steps(successor: Labels, planes: int, forward: Labels, backward: Labels) -> None:
    """Fill differences of node numbers in time (node,), 0 before, by successors (time - 1, y, x)."""
    frames, rows, columns = successor.shape
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    frame, difference = (planes + 1) * plane, np.empty(columns, np.int32)
    for t in range(frames):
        for y in range(rows):
            for x in range(columns):
                to = successor[t, y, x]
                difference[x] = frame + (to // columns - y) * row + to % columns - x if to >= 0 else 0
            for p in range(planes):
                first = (t * (planes + 1) + p + 1) * plane + (y + 1) * row + 1
                for x in range(columns):
                    if difference[x] != 0:
                        node = np.uint64(first + x)
                        forward[node], backward[node + np.uint64(difference[x])] = difference[x], -difference[x]


def node_values(volume: AnyArray) -> AnyArray:
    """Values of cells (time, plane, y, x) at their nodes, 0 at guards; (node,)."""
    nodes = np.zeros(_number(volume.shape), volume.dtype)
    cells(nodes, volume.shape)[:] = volume
    return nodes


def cells(nodes: AnyArray, shape: tuple[int, ...]) -> AnyArray:
    """View of node values as cells (time, plane, y, x), without guards."""
    frames, planes, rows, columns = shape
    guarded = (frames, planes + 1, rows + 1, columns + 1)
    return nodes[: np.prod(guarded)].reshape(guarded)[:, 1:, 1:, 1:]


def nodes_of(cell: Ints, shape: tuple[int, ...]) -> Ints:
    """Nodes of cells (k,) of the flattened grid."""
    _, planes, rows, columns = shape
    t, p, y, x = np.unravel_index(cell, shape)
    return np.asarray(((t * (planes + 1) + p + 1) * (rows + 1) + y + 1) * (columns + 1) + x + 1)


def _number(shape: tuple[int, ...]) -> int:
    """Number of nodes, with guards behind the last frame as far as the last cell's neighbours reach."""
    frames, planes, rows, columns = shape
    row, plane = columns + 1, (rows + 1) * (columns + 1)
    return (frames * (planes + 1) + 1) * plane + row + 1


@part
def neighbour(node: int, slot: int, lattice: Lattice) -> int:
    """Node at the end of an arc; 0, a guard, for an arc in time without an end."""
    # Unsigned places: none is negative, which is not asked here.
    to = node + int(lattice.steps[np.uint64(slot)])
    if slot < lattice.spatial:
        return to
    if slot & 1:
        step_in_time = int(lattice.backward[np.uint64(to)])
        return to + step_in_time if step_in_time != 0 else 0
    step_in_time = int(lattice.forward[np.uint64(node)])
    return to + step_in_time if step_in_time != 0 else 0
