"""What a frame's explanation leaves of one view's evidence at each cell (METHODS 7: evidence is used once).

Pixels of a cell's footprint that show somebody else do not speak for the cell. Where that person stands nearer to the
camera they hide it, and the view sees a share of the cell alone; where not, the pixels count, and count as empty. Whose
pixels are whose is known on a raster, some thirty rows to a body, so a footprint touches few raster pixels whatever the
image's resolution.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.accelerate import kernel
from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.geometry.summed_area import TOP, Levels, Sums, sum_of

SHOULDER = 0.3
"""A person hides what is at least this much farther from the camera than they are, metres."""


class PixelAssignment(NamedTuple):
    """Whom one view shows where.

    Attributes
    ----------
    raster : int16 (v, u)
        Person whose body is nearest at each raster pixel, -1 for nobody.
    step : int
        Image pixels to a raster pixel.
    row : int64 (image v,), column : int64 (image u,)
        Raster row and column of each row and column of the image.
    distance : float64 (person,)
        From the camera along the ground, metres.
    own : bool (person,)
        Whose evidence in this view is told apart already: nobody hides them.
    """

    raster: NDArray[np.int16]
    step: int
    row: Ints
    column: Ints
    distance: Floats
    own: Flags


@kernel
def _part(first: int, extent: int, step: int, k: int) -> int:
    """How many of the pixels first..first + extent - 1 lie in raster pixel k."""
    return min(first + extent, (k + 1) * step) - max(first, k * step)


@kernel
def fill_share(
    footprint: NDArray[np.int16],
    raster: NDArray[np.int16],
    step: int,
    row: Ints,
    column: Ints,
    person_distance: Floats,
    own: Flags,
    near: Ints,
    distance: Singles,
    share: Singles,
    shared: Flags,
) -> None:
    """Fill share (plane, y, x), how much of each footprint no nearer person hides, and shared, whether it shows others.

    Parameters
    ----------
    footprint : int16 (plane, y, x, 4)
        See `stseg.geometry.sampling`.
    raster, step, row, column, person_distance, own
        See `PixelAssignment`.
    near : int64 (y, x)
        Person near each cell, -1 for nobody.
    distance : float32 (y, x)
        From the camera along the ground, metres.
    """
    planes, rows, columns = share.shape
    for z in range(planes):
        for y in range(rows):
            for x in range(columns):
                share[z, y, x], shared[z, y, x] = 1.0, False
                left, top, width, height = footprint[z, y, x]
                mine = near[y, x]
                if width == 0 or (mine >= 0 and own[mine]):
                    continue
                hidden = 0
                for j in range(row[top], row[top + height - 1] + 1):
                    for i in range(column[left], column[left + width - 1] + 1):
                        person = raster[j, i]
                        if person < 0 or person == mine:
                            continue
                        shared[z, y, x] = True
                        if person_distance[person] < distance[y, x] - SHOULDER:
                            hidden += _part(top, height, step, j) * _part(left, width, step, i)
                if hidden > 0:
                    share[z, y, x] = 1.0 - np.float32(hidden) / np.float32(np.int32(width) * np.int32(height))


@kernel
def leave_unexplained(
    footprint: NDArray[np.int16],
    sums: Sums,
    left: int,
    top: int,
    raster: NDArray[np.int16],
    step: int,
    row: Ints,
    column: Ints,
    near: Ints,
    share: Singles,
    shared: Flags,
    levels: Levels,
) -> None:
    """Take out of levels (plane, y, x) what shows somebody else: the mean over what is seen of each footprint.

    Parameters
    ----------
    sums, left, top
        The map's sums, see `stseg.geometry.cell_means`.
    share : float32 (plane, y, x), shared : bool (plane, y, x)
        From `fill_share`.
    """
    planes, rows, columns = share.shape
    for z in range(planes):
        for y in range(rows):
            for x in range(columns):
                if not shared[z, y, x] or share[z, y, x] == 0.0:
                    continue
                first, start, width, height = footprint[z, y, x]
                taken = 0
                for j in range(row[start], row[start + height - 1] + 1):
                    for i in range(column[first], column[first + width - 1] + 1):
                        if raster[j, i] >= 0 and raster[j, i] != near[y, x]:
                            v, u = max(start, j * step) - top, max(first, i * step) - left
                            down, right = v + _part(start, height, step, j), u + _part(first, width, step, i)
                            taken += int(sum_of(sums, u, v, right, down))
                u, v = first - left, start - top
                rest = np.float32(int(sum_of(sums, u, v, u + width, v + height)) - taken)
                seen = np.float32(np.int32(width) * np.int32(height)) * share[z, y, x]
                levels[z, y, x] = min(int(rest / seen + np.float32(0.5)), TOP)
