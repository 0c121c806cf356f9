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

from stseg.accelerate import kernel, part
from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.geometry.cell_means import SumTable
from stseg.geometry.sampling import SeenCells
from stseg.geometry.summed_area import TOP, Levels, sum_of
from stseg.occupancy.fusion import Sums

SHOULDER = 0.3
"""A person hides what is at least this much farther from the camera than they are, metres."""


class PixelAssignment(NamedTuple):
    """The person that each pixel of a view shows.

    Attributes
    ----------
    raster : int16 (v, u)
        Person whose body is nearest at each raster pixel, -1 for none.
    occupied : int32 (v + 1, u + 1)
        Number of raster pixels above and to the left that show a person.
    step : int
        Image pixels to a raster pixel.
    row : int64 (image v,), column : int64 (image u,)
        Raster row and column of each row and column of the image.
    distance : float64 (person,)
        From the camera along the ground, metres.
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


@kernel
def fill_occupied(raster: NDArray[np.int16], occupied: Labels) -> None:
    """Fill occupied (v + 1, u + 1); see `PixelAssignment`."""
    occupied[0] = 0
    for v in range(raster.shape[0]):
        here = 0
        occupied[v + 1, 0] = 0
        for u in range(raster.shape[1]):
            here += 1 if raster[v, u] >= 0 else 0
            occupied[v + 1, u + 1] = occupied[v, u + 1] + here


@part
def _overlap(first: int, extent: int, step: int, k: int) -> int:
    """How many of the pixels first..first + extent - 1 lie in raster pixel k."""
    return min(first + extent, (k + 1) * step) - max(first, k * step)


@part
def _shows_a_person(shown: PixelAssignment, left: int, top: int, width: int, height: int) -> bool:
    above, below = shown.row[top], shown.row[top + height - 1] + 1
    first, stop = shown.column[left], shown.column[left + width - 1] + 1
    table = shown.occupied
    return bool(table[below, stop] - table[below, first] != table[above, stop] - table[above, first])


@part
def _hidden_pixels(
    shown: PixelAssignment, left: int, top: int, width: int, height: int, person: int, distance: float
) -> int:
    """Pixels of a footprint that show a person other than `person`, nearer than a cell at `distance`."""
    hidden = 0
    for j in range(shown.row[top], shown.row[top + height - 1] + 1):
        for i in range(shown.column[left], shown.column[left + width - 1] + 1):
            other = shown.raster[j, i]
            if other >= 0 and other != person and shown.distance[other] < distance - SHOULDER:
                hidden += _overlap(top, height, shown.step, j) * _overlap(left, width, shown.step, i)
    return hidden


@part
def _sum_of_others(
    shown: PixelAssignment, table: SumTable, left: int, top: int, width: int, height: int, person: int
) -> int:
    """Sum of the likelihood levels of a footprint's pixels that show a person other than `person`."""
    total = 0
    for j in range(shown.row[top], shown.row[top + height - 1] + 1):
        for i in range(shown.column[left], shown.column[left + width - 1] + 1):
            other = shown.raster[j, i]
            if other >= 0 and other != person:
                v, u = max(top, j * shown.step), max(left, i * shown.step)
                down = v + _overlap(top, height, shown.step, j) - table.top
                right = u + _overlap(left, width, shown.step, i) - table.left
                total += int(sum_of(table.sums, u - table.left, v - table.top, right, down))
    return total


@kernel
def fill_share(cells: SeenCells, shown: PixelAssignment, near: Ints, distance: Singles, share: Singles) -> None:
    """Fill share (plane, y, x) of the cells that a view sees: how much of each footprint no nearer person hides.

    Parameters
    ----------
    near : int64 (y, x)
        Person near each cell, -1 for none.
    distance : float32 (y, x)
        From the camera along the ground, metres.
    """
    person, cell_distance = near.reshape(-1), distance.reshape(-1)
    for z in range(len(share)):
        plane = share[z].reshape(-1)
        for k in range(cells.start[z], cells.start[z + 1]):
            place, whole = cells.place[k], np.float32(1)
            left, top, width, height = cells.footprint[k]
            nearest = person[place]
            if _shows_a_person(shown, left, top, width, height) and not (nearest >= 0 and shown.separate[nearest]):
                hidden = _hidden_pixels(shown, left, top, width, height, nearest, cell_distance[place])
                whole -= np.float32(hidden) / np.float32(np.int32(width) * np.int32(height))
            plane[place] = whole


@kernel
def add_map(
    cells: SeenCells,
    table: SumTable,
    shown: PixelAssignment,
    near: Ints,
    distance: Singles,
    terms: Singles,
    weight: np.float32,
    levels: Levels,
    share: Singles,
    sums: Sums,
) -> None:
    """Fill levels and share (plane, y, x) of the cells seen by a view with a likelihood map; add its terms to the sums.

    The level is the mean over the visible pixels of the footprint, those of other persons counted as background.
    """
    person, cell_distance = near.reshape(-1), distance.reshape(-1)
    for z in range(len(share)):
        level_of, share_of = levels[z].reshape(-1), share[z].reshape(-1)
        weighted, weights, count = sums.weighted[z].reshape(-1), sums.weights[z].reshape(-1), sums.shares[z].reshape(-1)
        for k in range(cells.start[z], cells.start[z + 1]):
            place = cells.place[k]
            left, top, width, height = cells.footprint[k]
            u, v = left - table.left, top - table.top
            total, pixels = int(sum_of(table.sums, u, v, u + width, v + height)), np.int32(width) * np.int32(height)
            nearest, visible = person[place], np.float32(1)
            if _shows_a_person(shown, left, top, width, height) and not (nearest >= 0 and shown.separate[nearest]):
                hidden = _hidden_pixels(shown, left, top, width, height, nearest, cell_distance[place])
                visible -= np.float32(hidden) / np.float32(pixels)
                if visible > 0:
                    total -= _sum_of_others(shown, table, left, top, width, height, nearest)
            mean = np.float32(total) / (np.float32(pixels) * (visible if visible > 0 else np.float32(1)))
            level = min(int(mean + np.float32(0.5)), TOP)
            level_of[place], share_of[place] = level, visible
            seen = weight * visible
            weighted[place] += seen * terms[1 if nearest >= 0 else 0, level]
            weights[place] += seen
            count[place] += visible
