"""Occlusion handling per cell: the part of a view's evidence that belongs to the cell, so that every pixel counts once.

Pixels of a cell's footprint that show another person are no evidence of the cell. Where that person stands nearer to
the camera they hide the cell, and the view sees only a share of it; otherwise the pixels count as background.
Which person a pixel shows is known on a raster, some thirty rows to a body, so a footprint meets few raster pixels
whatever the image's resolution. Most footprints show no person at all; a summed-area table finds them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.geometry.sampling import Footprints
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, Levels, SumTable, sum_of
from stseg.kernels.accelerate import kernel, part
from stseg.occupancy.shown_cells import Reach, ShownCells

SHOULDER = 0.3
"""A person hides what is at least this much farther from the camera than they are, metres."""


class PixelAssignment(NamedTuple):
    """The person that each pixel of a view shows.

    Attributes
    ----------
    raster : int16 (v, u)
        Person of the nearest body at each raster pixel, -1 for none.
    occupied : int32 (v + 1, u + 1)
        Number of raster pixels above and to the left that show a person.
    step : int
        Image pixels to a raster pixel.
    row : int64 (image v,), column : int64 (image u,)
        Raster row and column of each row and column of the image.
    distance : float64 (1 + person,)
        From the camera along the ground, metres; the first is that of no person, infinite.
    separate : bool (person,)
        Whether a box of this view is assigned to the person: the cells near such a person count as unoccluded.
    """

    raster: NDArray[np.int16]
    occupied: Labels
    step: int
    row: Ints
    column: Ints
    distance: Floats
    separate: Flags


@part
def _overlap(first: int, extent: int, step: int, k: int) -> int:
    """Number of the pixels first..first + extent - 1 in raster pixel k."""
    return min(first + extent, (k + 1) * step) - max(first, k * step)


@part
def _shows_a_person(assigned: PixelAssignment, left: int, top: int, width: int, height: int) -> bool:
    # Unsigned places: none is negative, which is not asked here.
    above, below = np.uint64(assigned.row[np.uint64(top)]), np.uint64(assigned.row[np.uint64(top + height - 1)] + 1)
    first, stop = (
        np.uint64(assigned.column[np.uint64(left)]),
        np.uint64(assigned.column[np.uint64(left + width - 1)] + 1),
    )
    table = assigned.occupied
    return bool(table[below, stop] - table[below, first] != table[above, stop] - table[above, first])


@part
def _hidden_pixels(
    assigned: PixelAssignment, left: int, top: int, width: int, height: int, person: int, distance: float
) -> int:
    """Pixels of a footprint that show a person other than `person`, nearer than a cell at `distance`."""
    hidden = 0
    for j in range(assigned.row[top], assigned.row[top + height - 1] + 1):
        for i in range(assigned.column[left], assigned.column[left + width - 1] + 1):
            other = assigned.raster[j, i]
            if other >= 0 and other != person and assigned.distance[other + 1] < distance - SHOULDER:
                hidden += _overlap(top, height, assigned.step, j) * _overlap(left, width, assigned.step, i)
    return hidden


@part
def _others_inside(
    assigned: PixelAssignment,
    table: SumTable,
    left: int,
    top: int,
    width: int,
    height: int,
    person: int,
    distance: float,
) -> tuple[int, int]:
    """`_hidden_pixels`, and the sum of the likelihood levels of all pixels that show a person other than `person`."""
    hidden, total = 0, 0
    above, below = np.uint64(assigned.row[np.uint64(top)]), np.uint64(assigned.row[np.uint64(top + height - 1)] + 1)
    first, stop = (
        np.uint64(assigned.column[np.uint64(left)]),
        np.uint64(assigned.column[np.uint64(left + width - 1)] + 1),
    )
    for j in range(above, below):
        v, end = max(top, j * assigned.step), min(top + height, (j + 1) * assigned.step)
        for i in range(first, stop):
            other = assigned.raster[j, i]
            if other >= 0 and other != person:
                u, until = max(left, i * assigned.step), min(left + width, (i + 1) * assigned.step)
                if assigned.distance[np.uint64(other + 1)] < distance - SHOULDER:
                    hidden += (end - v) * (until - u)
                total += int(sum_of(table.sums, u - table.left, v - table.top, until - table.left, end - table.top))
    return hidden, total


@kernel
def mark_people(reach: Reach, assigned: PixelAssignment, marked: Flags) -> None:
    """Mark the blocks (block,) with a person of a view in their boxes."""
    for b in range(len(marked)):
        left, top, right, bottom = reach[b]
        if right > 0 and not marked[b]:
            marked[b] = _shows_a_person(assigned, left, top, right - left, bottom - top)


@kernel
def fill_share(
    cells: ShownCells,
    marked: Flags,
    footprint: Footprints,
    assigned: PixelAssignment,
    distance: Singles,
    share: Singles,
) -> None:
    """Fill share (n,), 1 before, of the cells that a view sees: how much of each footprint no nearer person hides.

    Parameters
    ----------
    marked : bool (block,)
        Blocks at which the view shows something.
    footprint : int16 (cell, 4)
        In block order.
    distance : float32 (place,)
        In block order, of each ground cell from the camera along the ground, metres.
    """
    for b in range(len(cells.start) - 1):
        if not marked[cells.block[b]]:
            continue
        for k in range(cells.start[b], cells.start[b + 1]):
            left, top, width, height = footprint[np.uint64(cells.cell[k])]
            nearest = cells.near_person[k]
            if width == 0 or (nearest >= 0 and assigned.separate[nearest]):
                continue
            if _shows_a_person(assigned, left, top, width, height):
                hidden = _hidden_pixels(assigned, left, top, width, height, nearest, distance[cells.place[k]])
                share[k] = np.float32(1) - np.float32(hidden) / np.float32(np.int32(width) * np.int32(height))


@kernel
def fill_map(
    cells: ShownCells,
    marked: Flags,
    footprint: Footprints,
    table: SumTable,
    assigned: PixelAssignment,
    distance: Singles,
    levels: Levels,
    share: Singles,
) -> None:
    """Fill levels and share (n,) of the cells of marked blocks by a view with a map; UNSEEN where it does not see them.

    The level is the mean over the visible pixels of the footprint, those of other persons counted as background. Blocks
    marked bool (block,) are those at which the view shows something.
    """
    for b in range(len(cells.start) - 1):
        if marked[np.uint64(cells.block[b])]:
            for k in range(cells.start[b], cells.start[b + 1]):
                left, top, width, height = footprint[np.uint64(cells.cell[k])]
                nearest, far = cells.near_person[k], distance[cells.place[k]]
                if width == 1 and height == 1:
                    levels[k], share[k] = _of_one_pixel(left, top, nearest, far, table, assigned)
                else:
                    levels[k], share[k] = _of_pixels(left, top, width, height, nearest, far, table, assigned)


@part
def _of_one_pixel(
    left: int, top: int, nearest: int, far: float, table: SumTable, assigned: PixelAssignment
) -> tuple[int, np.float32]:
    """Level and share of a cell with a footprint of one pixel, as most have: few branches, which are not foreseen."""
    u, v = left - table.left, top - table.top
    level = int(sum_of(table.sums, u, v, u + 1, v + 1))
    other = assigned.raster[assigned.row[np.uint64(top)], assigned.column[np.uint64(left)]]
    is_other = (other >= 0) & (other != nearest)
    if nearest >= 0:
        is_other = is_other & (not assigned.separate[nearest])
    is_hidden = is_other & (assigned.distance[np.uint64(other + 1)] < far - SHOULDER)
    return 0 if is_other & (not is_hidden) else level, np.float32(0 if is_hidden else 1)


@part
def _of_pixels(
    left: int, top: int, width: int, height: int, nearest: int, far: float, table: SumTable, assigned: PixelAssignment
) -> tuple[int, np.float32]:
    """Level and share of a cell with any footprint; see `fill_map`."""
    if width == 0:
        return UNSEEN, np.float32(1)
    u, v = left - table.left, top - table.top
    total, pixels = int(sum_of(table.sums, u, v, u + width, v + height)), np.int32(width) * np.int32(height)
    visible, is_open = np.float32(1), not (nearest >= 0 and assigned.separate[nearest])
    if is_open and _shows_a_person(assigned, left, top, width, height):
        hidden, others = _others_inside(assigned, table, left, top, width, height, nearest, far)
        visible -= np.float32(hidden) / np.float32(pixels)
        if visible > 0:
            total -= others
    mean = np.float32(total) / (np.float32(pixels) * (visible if visible > 0 else np.float32(1)))
    return min(int(mean + np.float32(0.5)), TOP_LEVEL), visible
