"""Patches of the ground around people, side by side: a window is cut there alone, with the labels of the whole ground.

Let R be a part of a window's cells that holds all cells with u > 0, and G the greatest empty set (the set rule of
`stseg.graphcut.sign_sets`) of the energy on R alone, its edges to other cells left out. If every cell of R with an edge
to a cell outside R is in G, then G and all cells outside R together obey the set rule in the whole energy: the cells of
G have no edges but those within R and some into the set, the cells outside R have u <= 0 and edges into the set alone.
So all cells outside R have label 0 in the minimum with the smallest source set. Conversely, what the whole energy's
greatest empty set has in R obeys the rule on R alone, so it is G: the cells that are left undecided are the same, with
the same edges, and so is their minimum.

Patches grow until their borders are in G. They hold the cells of all people, so edges in time stay within a patch;
elsewhere a cell's successor is the same cell.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, find_objects
from scipy.ndimage import label as connected

from stseg.arrays import AnyArray, Flags, Floats, Ints, Labels, Singles
from stseg.geometry import Grid
from stseg.kernels.accelerate import kernel
from stseg.records.sparse_volume import SparseVolume
from stseg.segmentation.cell_motion import successor_cells

SQUARE_SIDE = 4
"""Cells along the side of the squares of which patches are made, and least distance of a patch's border."""
_BETWEEN = np.float32(-30.0)
"""Log-odds of what is between patches, nats."""
EIGHT_NEIGHBOURS = np.ones((3, 3), bool)
"""Cells that touch at edges or corners are connected."""


@dataclass(frozen=True)
class GroundPatches:
    """Parts of a grid's ground, each in a rectangle of a sheet (row, column), with nothing between them."""

    grid: Grid
    rectangles: tuple[tuple[slice, slice], ...]
    """Rows and columns of the sheet."""
    place: Ints
    """int64 (row, column): ground cell of each, in the flattened ground; -1 between patches."""

    @classmethod
    def of(cls, grid: Grid, squares: Flags) -> Self:
        """Patches that hold the marked squares, bool (square row, square column), and all beside them."""
        rows, columns = grid.shape[1:]
        grown = binary_dilation(squares, EIGHT_NEIGHBOURS).repeat(SQUARE_SIDE, 0).repeat(SQUARE_SIDE, 1)
        piece = np.asarray(connected(grown[:rows, :columns], EIGHT_NEIGHBOURS)[0], np.int32)
        return cls(grid, *_arranged(piece))

    @cached_property
    def ground(self) -> Floats:
        """Cell centres, metres, float64 (row, column, 2); infinite between patches."""
        ground = np.full((*self.place.shape, 2), np.inf)
        ground[self.place >= 0] = self.grid.ground.reshape(-1, 2)[self.place[self.place >= 0]]
        return ground

    @cached_property
    def border(self) -> Flags:
        """Cells beside ground outside their patch, bool (row, column)."""
        inside = np.zeros(self.grid.shape[1:], bool)
        inside.reshape(-1)[self.place[self.place >= 0]] = True
        edge = inside & ~binary_erosion(inside, EIGHT_NEIGHBOURS, border_value=1)
        return np.asarray(self.on_sheet(edge))

    @cached_property
    def _counted_place(self) -> Ints:
        """The same places; -1 beside the grid's polygon, too."""
        if self.grid.polygon is None:
            return self.place
        return np.where(self.grid.inside().reshape(-1)[self.place], self.place, -1)

    @cached_property
    def on_sheet_at(self) -> Labels:
        """Place on the flattened sheet of each cell of the flattened ground, int32 (ground cell,); -1 for none."""
        index = np.full(self.grid.shape[1] * self.grid.shape[2], -1, np.int32)
        inside = self.place.reshape(-1) >= 0
        index[self.place.reshape(-1)[inside]] = np.flatnonzero(inside)
        return index

    def on_sheet(self, values: AnyArray) -> AnyArray:
        """Values of ground cells (y, x) at their places on the sheet (row, column), 0 between patches."""
        return np.where(self.place >= 0, values.reshape(-1)[self.place], np.zeros(1, values.dtype))

    def on_ground(self, values: AnyArray) -> AnyArray:
        """Values on the sheet (row, column) at their ground cells (y, x), 0 outside the patches."""
        ground, inside = np.zeros(self.grid.shape[1:], values.dtype), self.place >= 0
        ground.reshape(-1)[self.place[inside]] = values[inside]
        return ground

    def log_odds(self, volume: SparseVolume) -> Singles:
        """A frame's log-odds on the sheet, float32 (plane, row, column), nats; nan where no view sees the cell.

        Ground beside the grid's polygon is as empty as what is between patches: undecided, it would join a body at the
        polygon's edge, and patches would grow over all of it.
        """
        sheet = np.empty((self.grid.planes, *self.place.shape), np.float32)
        _fill_sheet(
            volume.of_cell.reshape(-1),
            volume.empty,
            volume.cell,
            volume.value,
            self._counted_place.reshape(-1),
            self.on_sheet_at,
            _BETWEEN,
            sheet.reshape(self.grid.planes, -1),
        )
        return sheet

    def successors(self, motion: Ints) -> Labels:
        """Cell of the sheet in the next frame, int32 (time, row, column), -1 for none: see `successor_cells`.

        Motion int64 (time, row, column, 2) is that of the cells of the sheet; it stays within each patch.
        """
        columns, sheet = self.place.shape[1], np.full(motion.shape[:3], -1, np.int32)
        for down, across in self.rectangles:
            cells = successor_cells(np.ascontiguousarray(motion[:, down, across]))
            row, column = np.divmod(cells, across.stop - across.start)
            to = (row + down.start) * columns + column + across.start
            sheet[:, down, across] = np.where((cells >= 0) & (self.place[down, across] >= 0), to, -1)
        return sheet


def _arranged(piece: Labels) -> tuple[tuple[tuple[slice, slice], ...], Ints]:
    """Rectangles and places of the pieces of the ground (y, x), numbered from 1: on shelves, the tallest first."""
    flat, found = np.arange(piece.size).reshape(piece.shape), find_objects(piece)
    cells = [np.where(piece[here] == k, flat[here], -1) for k, here in enumerate(found, start=1)]
    cells.sort(key=len, reverse=True)
    wide = max([1, math.isqrt(sum(one.size for one in cells)), *(one.shape[1] for one in cells)])
    rectangles, top, left, tall = [], 0, 0, len(cells[0]) if cells else 1
    for one in cells:
        if left + one.shape[1] > wide:
            top, left, tall = top + tall + 1, 0, len(one)
        rectangles.append((slice(top, top + len(one)), slice(left, left + one.shape[1])))
        left += one.shape[1] + 1
    place = np.full((top + tall, wide), -1, np.int64)
    for rectangle, one in zip(rectangles, cells, strict=True):
        place[rectangle] = one
    return tuple(rectangles), place


def people_squares(grid: Grid, ground: Floats, ahead: Floats, reach: float) -> Flags:
    """Squares that people's cells cover on their way to the next frame, bool (square row, square column).

    `ground` and `ahead` float64 (n, 2) are their places in a frame and in the next, and `reach` is that of a body's
    cells around its place, all in metres.
    """
    squares = no_squares(grid)
    corners = np.sort(np.stack([grid.cell_of(ground), grid.cell_of(ahead)]), axis=0)
    margin = reach / grid.cell + 1
    first = np.floor((corners[0] - margin) / SQUARE_SIDE).astype(np.int64).clip(0)
    last = np.floor((corners[1] + margin) / SQUARE_SIDE).astype(np.int64)
    for (left, top), (right, bottom) in zip(first.tolist(), last.tolist(), strict=True):
        if right >= 0 and bottom >= 0:
            squares[top : bottom + 1, left : right + 1] = True
    return squares


def no_squares(grid: Grid) -> Flags:
    """No square marked, bool (square row, square column)."""
    return np.zeros([-(-side // SQUARE_SIDE) for side in grid.shape[1:]], bool)


def mark_places(squares: Flags, places: Ints, grid: Grid) -> None:
    """Mark the squares of ground cells (k,) of the flattened ground."""
    y, x = np.divmod(places, grid.shape[2])
    squares[y // SQUARE_SIDE, x // SQUARE_SIDE] = True


@kernel
def _fill_sheet(
    of_cell: Labels,
    empty: Singles,
    cell: Labels,
    value: Singles,
    place: Ints,
    index: Labels,
    between: np.float32,
    sheet: Singles,
) -> None:
    """Fill sheet (plane, place on the sheet); index (ground cell,) is each one's place on it, -1 for none.

    `place` (place on the sheet,) is the ground cell of each, -1 for what is `between`.
    """
    planes, ground = sheet.shape[0], len(index)
    for z in range(planes):
        for k in range(len(place)):
            sheet[z, k] = empty[of_cell[z * ground + place[k]]] if place[k] >= 0 else between
    z = 0
    for c in range(len(cell)):
        if not 0 <= cell[c] - z * ground < ground:  # seldom: cells come plane by plane
            z = cell[c] // ground
        k = index[cell[c] - z * ground]
        if k >= 0 and place[k] >= 0:
            sheet[z, k] = value[c]
