"""Occlusion handling per cell: the part of a view's evidence that belongs to the cell, so that every pixel counts once.

Pixels of a cell's footprint that show another person are no evidence of the cell. Where that person stands nearer to
the camera they hide the cell, and the view sees only a share of it; otherwise the pixels count as background.
Which person a pixel shows is known on a raster, some thirty rows to a body, so a footprint meets few raster pixels
whatever the image's resolution. Most footprints show no person at all; a summed-area table finds them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.geometry.sampling import Footprints
from stseg.geometry.summed_area import TOP_LEVEL, UNSEEN, Levels, SumTable, sum_of
from stseg.kernels.accelerate import kernel, part
from stseg.occupancy.shown_cells import Reach, ShownCells, adjacent_cells

SHOULDER = 0.3
"""A person hides what is at least this much farther from the camera than they are, metres."""


class PixelAssignment(NamedTuple):
    """The person that each pixel of a view shows."""

    raster: NDArray[np.int16]
    """int16 (v, u): person of the nearest body at each raster pixel, -1 for none."""
    occupied: Labels
    """int32 (v + 1, u + 1): number of raster pixels above and to the left that show a person."""
    step: int
    """Image pixels to a raster pixel."""
    row: Ints
    """int64 (image v,): raster row of each row of the image."""
    column: Ints
    """int64 (image u,): raster column of each column of the image."""
    distance: Floats
    """float64 (1 + person,): from the camera along the ground, metres; the first is that of no person, infinite."""
    separate: Flags
    """bool (person,): whether a box of this view is assigned to the person: the cells near such a person count as
    unoccluded."""


@part
def _overlap(first: int, extent: int, step: int, k: int) -> int:
    """Number of the pixels first..first + extent - 1 in raster pixel k."""
    return min(first + extent, (k + 1) * step) - max(first, k * step)


@part
def _shows_a_person(assigned: PixelAssignment, left: int, top: int, width: int, height: int) -> bool:
    # Unsigned places: none is negative, which is not asked here.
    above, below = np.uint64(assigned.row[np.uint64(top)]), np.uint64(assigned.row[np.uint64(top + height - 1)] + 1)
    first = np.uint64(assigned.column[np.uint64(left)])
    stop = np.uint64(assigned.column[np.uint64(left + width - 1)] + 1)
    table = assigned.occupied
    return bool(table[below, stop] - table[below, first] != table[above, stop] - table[above, first])


@part
def _hidden_pixels(
    assigned: PixelAssignment, left: int, top: int, width: int, height: int, person: int, distance: float
) -> int:
    """Pixels of a footprint that show a person other than `person`, nearer than a cell at `distance`."""
    # There is no branch: what it depends on is not foreseen. No person is infinitely far.
    hidden, limit = 0, distance - SHOULDER
    for j in range(assigned.row[top], assigned.row[top + height - 1] + 1):
        across = 0
        for i in range(assigned.column[left], assigned.column[left + width - 1] + 1):
            other = assigned.raster[np.uint64(j), np.uint64(i)]
            is_hidden = (assigned.distance[np.uint64(other + 1)] < limit) & (other != person)
            across += is_hidden * _overlap(left, width, assigned.step, i)
        hidden += across * _overlap(top, height, assigned.step, j)
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
    first = np.uint64(assigned.column[np.uint64(left)])
    stop = np.uint64(assigned.column[np.uint64(left + width - 1)] + 1)
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
    """Mark the blocks (block,) with a person of a view in their boxes; `occupied`, 0 before, is filled first."""
    for v in range(len(assigned.raster)):
        total, line, above = np.int32(0), assigned.raster[v], assigned.occupied[v]
        for u in range(len(line)):
            total += np.int32(line[u] >= 0)
            assigned.occupied[v + 1, u + 1] = above[u + 1] + total
    for b in range(len(marked)):
        left, top, right, bottom = reach[b]
        if right > 0 and not marked[b]:
            marked[b] = _shows_a_person(assigned, left, top, right - left, bottom - top)


@kernel
def fill_empty(cells: ShownCells, unseen: Levels, empty: int, levels: Levels, share: Singles) -> None:
    """Fill levels and share (n + k,) of a view as if it showed nothing; see `CellTables.unseen`."""
    b, level, before = 0, np.int16(empty), len(unseen) - len(levels)
    for k in range(cells.start[-1], len(levels)):
        levels[k] = unseen[before + k] | level  # all bits of UNSEEN are set
    while b < len(cells.block):
        listed, every, b = adjacent_cells(cells, b)
        target, source = levels[listed], unseen[every]
        for k in range(len(target)):
            target[k] = source[k] | level
    share[:] = 1.0


@kernel
def fill_share(
    cells: ShownCells,
    marked: Flags,
    place: Labels,
    footprint: Footprints,
    assigned: PixelAssignment,
    distance: Singles,
    share: Singles,
) -> None:
    """Fill share (n,), 1 before, of the cells that a view sees: how much of each footprint no nearer person hides.

    Blocks at which the view shows something are marked, bool (block,). `place` int32 (cell,) and `footprint` int16
    (cell, 4) are those of `CellTables`; `distance` float32 (place,) is that from the camera along the ground, metres.
    """
    for b in range(len(cells.start) - 1):
        if not marked[cells.block[b]]:
            continue
        shift = cells.first[b] - cells.start[b]
        for k in range(cells.start[b], cells.start[b + 1]):
            left, top, width, height = footprint[np.uint64(k + shift)]
            nearest = cells.near_person[k]
            if width == 0 or (nearest >= 0 and assigned.separate[nearest]):
                continue
            if _shows_a_person(assigned, left, top, width, height):
                hidden = _hidden_pixels(assigned, left, top, width, height, nearest, distance[place[k + shift]])
                share[k] = np.float32(1) - np.float32(hidden) / np.float32(np.int32(width) * np.int32(height))


@kernel
def fill_map(
    cells: ShownCells,
    marked: Flags,
    place: Labels,
    footprint: Footprints,
    table: SumTable,
    assigned: PixelAssignment,
    distance: Singles,
    few: int,
    levels: Levels,
    share: Singles,
) -> None:
    """Fill levels and share (n,) of a view with a map in the marked blocks; elsewhere they are those of `fill_empty`.

    The level is the mean over the visible pixels of the footprint, those of other persons counted as background. The
    parameters are those of `fill_share`; footprints of at most `few` pixels in a row are read pixel by pixel.
    """
    pixels = _shown_pixels(table, assigned) if few > 0 else np.empty(0, np.int32)
    columns = table.sums.shape[1] - 1
    for b in range(len(cells.start) - 1):
        if not marked[np.uint64(cells.block[b])]:
            continue
        shift = cells.first[b] - cells.start[b]
        for k in range(np.uint64(cells.start[b]), np.uint64(cells.start[b + 1])):
            left, top, width, height = footprint[np.uint64(k + shift)]
            nearest, far = cells.near_person[k], distance[np.uint64(place[np.uint64(k + shift)])]
            if height == 1 and width <= few:
                first = (top - table.top) * columns + left - table.left
                levels[k], share[k] = _of_two_pixels(first, first + width - 1, nearest, far, pixels, assigned)
            else:
                levels[k], share[k] = _of_pixels(left, top, width, height, nearest, far, table, assigned)


@kernel
def _shown_pixels(table: SumTable, assigned: PixelAssignment) -> Labels:
    """The level of each pixel that a table covers and TOP_LEVEL + 1 times (1 + the person that it shows, -1 for none).

    Pixels are read once, row by row, since most cells have one or two of them: int32 (v * u,).
    """
    rows, columns = table.sums.shape[0] - 1, table.sums.shape[1] - 1
    pixels = np.empty(rows * columns, np.int32)
    for v in range(rows):
        line = assigned.raster[np.uint64(assigned.row[table.top + v])]
        for u in range(columns):
            person = np.int32(line[np.uint64(assigned.column[table.left + u])]) + np.int32(1)
            level = np.int32(sum_of(table.sums, u, v, u + 1, v + 1))
            pixels[v * columns + u] = level + np.int32(TOP_LEVEL + 1) * person
    return pixels


@part
def _of_two_pixels(
    one: int, other: int, nearest: int, far: float, pixels: Labels, assigned: PixelAssignment
) -> tuple[int, np.float32]:
    """Level and share of a cell with two pixels, or with one, which counts twice; most have no more.

    There is no branch: what it depends on is not foreseen.
    """
    limit, a, b = far - SHOULDER, np.uint32(pixels[np.uint64(one)]), np.uint32(pixels[np.uint64(other)])
    person, neighbour = a // np.uint32(TOP_LEVEL + 1), b // np.uint32(TOP_LEVEL + 1)
    is_open = (person == 0) | (person == np.uint32(nearest + 1))
    is_neighbour_open = (neighbour == 0) | (neighbour == np.uint32(nearest + 1))
    hidden = np.int32((assigned.distance[np.uint64(person)] < limit) & (not is_open))
    neighbour_hidden = np.int32((assigned.distance[np.uint64(neighbour)] < limit) & (not is_neighbour_open))
    level = np.int32(a % np.uint32(TOP_LEVEL + 1)) * np.int32(is_open) * (np.int32(1) + neighbour_hidden)
    level += np.int32(b % np.uint32(TOP_LEVEL + 1)) * np.int32(is_neighbour_open) * (np.int32(1) + hidden)
    return int(level + 1) >> 1, np.float32(1) - np.float32(0.5) * np.float32(hidden + neighbour_hidden)


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
