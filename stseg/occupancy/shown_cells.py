"""The cells of a frame at which some view shows something; of all others one stands for many.

Where no view shows foreground or a person, and none is near, every view that sees a cell has its *empty level* (of a
map the lowest in the frame: certain background) and nothing hidden. What such a cell sums to depends on the set of
views that see it and on nothing else. So the cells at which something is shown are fused one by one, and behind them
one representative of each set of views, by the same kernels: the volume is that of all cells fused one by one, bit for
bit.

Blocks of cells, not cells, are asked whether something is shown: the box around a block's footprints in each view, by
the summed-area tables that hold the likelihoods and the people's pixels.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import AnyArray, Bytes, Flags, Floats, Ints, Labels
from stseg.geometry.sampling import Footprints
from stseg.geometry.summed_area import UNSEEN, Levels, SumTable, sum_of
from stseg.kernels.accelerate import kernel

BLOCK_SIDE = 4
"""Cells along the side of a block."""
_NEARLY_ALL = 0.75
"""Share of blocks from which all are taken: to list cells anew in each frame would cost more than to fuse the rest."""
_MOST_PIXELS = 1 << 20
"""Pixels up to which a sum of levels fits into 32 bits; blocks with more are taken to show something."""
_MOST_COUNTED = 1 << 17
"""Cells (n,) of which each stands for itself; of more, every second, third, ... block stands for the next ones."""
_CODE_VIEWS = 60
"""Number of views with sets that one whole number codes."""

Reach = NDArray[np.int16]
"""int16 (plane, block row, block column, 4): left, top, right, bottom of the box around a block's footprints, pixels;
right 0 where the view sees none of its cells."""


class ViewSets(NamedTuple):
    """Sets of views that see a cell.

    Attributes
    ----------
    of_cell : int32 (plane, y, x)
        The set of each cell.
    seen_by : bool (set, view)
        The views of each set.
    size : int64 (set,)
        Number of cells of each set.
    """

    of_cell: Labels
    seen_by: Flags
    size: Ints


class ShownCells(NamedTuple):
    """The cells (n,) of a frame that are fused one by one, and the representatives (k,) of the others.

    Attributes
    ----------
    cell : int32 (n,)
        Index in the flattened volume.
    place : int32 (n,)
        Index in the flattened ground.
    block : int32 (b,)
        The blocks that have any, as indices among those of all planes.
    start : int32 (b + 1,)
        First cell of each block, and n behind the last one.
    unseen : int16 (view, n + k)
        UNSEEN where the view does not see it, else 0.
    near_person : int32 (n + k,)
        The person near each, -1 for none.
    number : float64 (n + k,)
        Cells that each stands for where some are counted for all: 0 for those that are left out.
    """

    cell: Labels
    place: Labels
    block: Labels
    start: Labels
    unseen: Levels
    near_person: Labels
    number: Floats


class _MarkedCells(NamedTuple):
    """The marked blocks, and what they make of `ShownCells`."""

    marked: Flags
    cell: Labels
    place: Labels
    block: Labels
    start: Labels
    unseen: Levels
    number: Floats


class CellTables:
    """Tables of a rig's cells, and the cells of the last frame's blocks.

    Parameters
    ----------
    footprint : int16 (view, plane, y, x, 4)
        See `stseg.geometry.sampling`.
    """

    def __init__(self, footprint: Footprints) -> None:
        self.footprint = footprint
        self.reach = [_reach(boxes) for boxes in footprint]
        self._cells: _MarkedCells | None = None

    @cached_property
    def sets(self) -> ViewSets:
        """The sets of views that occur."""
        shape = self.footprint.shape[1:4]
        code = np.zeros(shape, np.int64)
        for k, boxes in enumerate(self.footprint):
            if k and k % _CODE_VIEWS == 0:
                code = np.unique(code, return_inverse=True)[1].reshape(shape)
            code += code + (boxes[..., 2] > 0)
        _, example, of_cell, size = np.unique(code, return_index=True, return_inverse=True, return_counts=True)
        seen_by = self.footprint.reshape(len(self.footprint), -1, 4)[:, example, 2] > 0
        return ViewSets(of_cell.reshape(shape).astype(np.int32), np.ascontiguousarray(seen_by.T), size.astype(np.int64))

    def nothing_marked(self) -> Flags:
        """No block marked, bool (plane, block row, block column)."""
        return np.zeros(self.reach[0].shape[:3], bool)

    def cells_at(self, marked: Flags, near_person: Ints, views: Bytes) -> ShownCells:
        """The cells of the marked blocks, as far as a view sees them.

        Parameters
        ----------
        marked : bool (plane, block row, block column)
            Blocks at which a view shows something, or near a person.
        near_person : int64 (y, x)
            The person near each cell, -1 for none.
        views : uint8 (plane, y, x)
            Number of views that see each cell.
        """
        if marked.mean() > _NEARLY_ALL:
            marked = np.ones_like(marked)
        if self._cells is None or not np.array_equal(marked, self._cells.marked):
            self._cells = self._cells_of(marked, views)
        _, cell, place, block, start, unseen, number = self._cells
        person = np.full(len(number), -1, np.int32)
        nearest = near_person.reshape(-1).astype(np.int32)
        np.take(nearest, place, out=person[: len(place)], mode="clip")  # no copy of `out`
        return ShownCells(cell, place, block, start, unseen, person, number)

    def _cells_of(self, marked: Flags, views: Bytes) -> _MarkedCells:
        sets, most = self.sets, int(marked.sum()) * BLOCK_SIDE**2
        cell, place, block, view_set = np.empty((4, most), np.int32)
        others = sets.size.copy()
        count = _fill_cells(marked, views, sets.of_cell, cell, place, block, view_set, others)
        start = np.append(np.flatnonzero(np.diff(block[:count], prepend=-1)), count).astype(np.int32)
        seen_by = np.concatenate([sets.seen_by[view_set[:count]], sets.seen_by])
        unseen = np.where(np.ascontiguousarray(seen_by.T), np.int16(0), np.int16(UNSEEN))
        number = np.concatenate([_cell_numbers(count), others])
        return _MarkedCells(marked.copy(), cell[:count], place[:count], block[start[:-1]], start, unseen, number)


def _cell_numbers(count: int) -> Floats:
    """Number of cells that each of `count` stands for; those of a block show nearly the same pixels."""
    stride, number = 1 + count // _MOST_COUNTED, np.zeros(count)
    number[np.arange(count) // BLOCK_SIDE**2 % stride == 0] = stride
    return number


@kernel
def mark_map(reach: Reach, table: SumTable, marked: Flags) -> None:
    """Mark the blocks (plane, row, column) with a level of a view's map above its lowest in their boxes."""
    for z in range(marked.shape[0]):
        for j in range(marked.shape[1]):
            for i in range(marked.shape[2]):
                left, top, right, bottom = reach[z, j, i]
                if right > 0 and not marked[z, j, i]:
                    pixels = (np.int64(right) - left) * (np.int64(bottom) - top)
                    u, v = left - table.left, top - table.top
                    total = sum_of(table.sums, u, v, right - table.left, bottom - table.top)
                    marked[z, j, i] = pixels > _MOST_PIXELS or total != table.lowest * pixels


def blocks_of(values: AnyArray, reduced: np.ufunc) -> AnyArray:
    """Values of cells (plane, y, x, ...) reduced over blocks, (plane, block row, block column, ...)."""
    rows, columns = (np.arange(0, side, BLOCK_SIDE) for side in values.shape[1:3])
    return np.asarray(reduced.reduceat(reduced.reduceat(values, rows, 1), columns, 2))


def _reach(footprint: Footprints) -> Reach:
    """The boxes around the footprints (plane, y, x, 4) of a view's blocks."""
    first, extent = footprint[..., :2], footprint[..., 2:]
    visible = extent[..., :1] > 0
    low = blocks_of(np.where(visible, first, np.iinfo(np.int16).max), np.minimum)
    high = blocks_of(np.where(visible, first + extent, 0), np.maximum)
    return np.where(high[..., :1] > 0, np.concatenate([low, high], -1), 0).astype(np.int16)


@kernel
def _fill_cells(
    marked: Flags,
    views: Bytes,
    of_cell: Labels,
    cell: Labels,
    place: Labels,
    block: Labels,
    view_set: Labels,
    others: Ints,
) -> int:
    """Fill cell, place, block and view_set (n,) of the cells of marked blocks that a view sees; their number.

    They are taken from the number of cells of each set, others (set,).
    """
    planes, rows, columns = views.shape
    count = 0
    for z in range(planes):
        for j in range(marked.shape[1]):
            for i in range(marked.shape[2]):
                if marked[z, j, i]:
                    for y in range(j * BLOCK_SIDE, min((j + 1) * BLOCK_SIDE, rows)):
                        for x in range(i * BLOCK_SIDE, min((i + 1) * BLOCK_SIDE, columns)):
                            if views[z, y, x] > 0:
                                cell[count], place[count] = (z * rows + y) * columns + x, y * columns + x
                                block[count] = (z * marked.shape[1] + j) * marked.shape[2] + i
                                view_set[count] = of_cell[z, y, x]
                                others[of_cell[z, y, x]] -= 1
                                count += 1
    return count
