"""The cells of a frame at which some view shows something; of all others one stands for many.

Where no view shows foreground or a person, and none is near, every view that sees a cell has its *empty level* (of a
map the lowest in the frame: certain background) and nothing hidden. What such a cell sums to depends on the set of
views that see it and on nothing else. So the cells at which something is shown are fused one by one, and behind them
one representative of each set of views, by the same kernels: the volume is that of all cells fused one by one, bit for
bit.

Blocks of cells, not cells, are asked whether something is shown: the box around a block's footprints in each view, by
the summed-area tables that hold the likelihoods and the people's pixels.

All tables hold the cells that a view sees in *block order*, plane by plane: a block's lie side by side in memory.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.geometry.sampling import Footprints
from stseg.geometry.summed_area import UNSEEN, Levels, SumTable, sum_of
from stseg.kernels.accelerate import kernel, part

BLOCK_SIDE = 4
"""Cells along the side of a block."""
_NEARLY_ALL = 0.75
"""Share of blocks from which all are taken: to list cells anew in each frame would cost more than to fuse the rest."""
_MOST_PIXELS = 1 << 20
"""Pixels up to which a sum of levels fits into 32 bits; blocks with more are taken to show something."""
_MOST_COUNTED = 1 << 15
"""Cells (n,) of which each stands for itself; of more, every second, third, ... block stands for the next ones."""
_FEW_PIXELS, _LEAST_SHARE = 2, 0.1
"""Pixels of a footprint that is read pixel by pixel, and share of such ones from which it is worth while."""
_CODE_VIEWS = 60
"""Number of views with sets that one whole number codes."""

Reach = NDArray[np.int16]
"""int16 (block, 4): left, top, right, bottom of the box around a block's footprints, pixels; right 0 where the view
sees none of its cells."""


class ViewSets(NamedTuple):
    """Sets of views that see a cell."""

    of_cell: Labels
    """int32 (cell,): the set of each cell that a view sees, in block order."""
    seen_by: Flags
    """bool (set, view): the views of each set."""
    size: Ints
    """int64 (set,): number of cells of each set."""


class ShownCells(NamedTuple):
    """The cells (n,) of a frame that are fused one by one, and the representatives (k,) of the others."""

    block: Labels
    """int32 (b,): the blocks that have any, as indices among those of all planes."""
    start: Labels
    """int32 (b + 1,): first cell of each block among these, and n behind the last one."""
    first: Labels
    """int32 (b,): first cell of each block in block order, among all cells that a view sees."""
    in_volume: Labels
    """int32 (n,): index in the flattened volume."""
    others: Floats
    """float64 (k,): cells that each representative stands for."""
    near_person: Labels
    """int32 (n + k,): the person near each, -1 for none."""

    def counted(self) -> tuple[Ints, Floats]:
        """Those that are counted, near a person or for others as well, and the number that each of these stands for.

        Cells of a block show nearly the same pixels.
        """
        listed, side, is_counted = len(self.in_volume), BLOCK_SIDE**2, self.near_person >= 0
        stride, is_counted[listed:] = 1 + listed // _MOST_COUNTED, True
        for cell in range(side):
            is_counted[cell : listed : stride * side] = True
        cells = np.flatnonzero(is_counted)
        return cells, np.where(cells < listed, stride, self.others[np.maximum(cells - listed, 0)])


class CellTables:
    """Tables of a rig's cells, and the cells of the last frame's blocks.

    Parameters
    ----------
    footprint : int16 (view, plane, y, x, 4)
        See `stseg.geometry.sampling`.
    """

    def __init__(self, footprint: Footprints) -> None:
        self.shape = planes, rows, columns = footprint.shape[1:4]
        y, x = np.indices((rows, columns)) // BLOCK_SIDE
        block = (y * columns + x).reshape(-1)
        self.ground = np.argsort(block, kind="stable")
        """int64 (place,): the ground cells in block order, as indices in the flattened ground."""
        self.ground_start = np.unique(block[self.ground], return_index=True)[1]
        """int64 (block of one plane,): the first ground cell of each block."""
        first = np.arange(planes)[:, None] * len(self.ground)
        start, order = (first + self.ground_start).reshape(-1), (first + self.ground).reshape(-1)
        views = footprint.reshape(len(footprint), -1, 4)
        self.reach = [_reach(boxes[order], start) for boxes in views]
        """One for each view."""
        is_seen = np.logical_or.reduce(views[..., 2] > 0)[order]
        self.in_volume, place = order[is_seen].astype(np.int32), np.flatnonzero(is_seen) % len(self.ground)
        self.footprint, self.place = views.take(self.in_volume, 1), place.astype(np.int32)
        """int16 (view, cell, 4) and int32 (cell,), as `in_volume` (see `ShownCells`): of the cells that a view sees,
        in block order."""
        is_small = (self.footprint[..., 3] == 1) & (self.footprint[..., 2] <= _FEW_PIXELS)
        self.few = np.where(is_small.sum(1) > _LEAST_SHARE * len(place), _FEW_PIXELS, 0)
        """int64 (view,): footprints of at most so many pixels in a row are read one by one; 0 where hardly any are."""
        self._width = np.add.reduceat(is_seen, start, dtype=np.int64)  # cells of each block
        self._first = (self._width.cumsum() - self._width).astype(np.int32)
        self._marked, self._cells = self.nothing_marked(), self._cells_of(self.nothing_marked())

    @cached_property
    def sets(self) -> ViewSets:
        """The sets of views that occur, but for none."""
        code = np.zeros(len(self.in_volume), np.int64)
        for k, boxes in enumerate(self.footprint):
            if k and k % _CODE_VIEWS == 0:
                code = np.unique(code, return_inverse=True)[1]
            code += code + (boxes[:, 2] > 0)
        _, example, of_cell, size = np.unique(code, return_index=True, return_inverse=True, return_counts=True)
        return ViewSets(of_cell.astype(np.int32), (self.footprint[:, example, 2] > 0).T.copy(), size.astype(np.int64))

    @cached_property
    def unseen(self) -> Levels:
        """UNSEEN where a view does not see a cell, else 0, then the same of each set: int16 (view, cell + set)."""
        is_seen = np.concatenate([self.footprint[..., 2] > 0, self.sets.seen_by.T], 1)
        return np.where(is_seen, np.int16(0), np.int16(UNSEEN))

    @cached_property
    def set_of_cell(self) -> Labels:
        """The set of views of each cell, int32 (plane, y, x): one behind the last where no view sees it."""
        of_cell = np.full(self.shape, len(self.sets.size), np.int32)
        of_cell.reshape(-1)[self.in_volume] = self.sets.of_cell
        return of_cell

    def nothing_marked(self) -> Flags:
        """No block marked, bool (block,)."""
        return np.zeros(len(self._width), bool)

    def cells_at(self, marked: Flags, near_person: Ints) -> ShownCells:
        """The cells of the marked blocks bool (block,), as far as a view sees them, valid until the next are asked for.

        `near_person` int64 (place,) is the person near each ground cell, -1 for none.
        """
        if marked.mean() > _NEARLY_ALL:
            marked = np.ones_like(marked)
        if not np.array_equal(marked, self._marked):
            self._marked, self._cells = marked.copy(), self._cells_of(marked)
        _fill_near(self._cells, self.place, near_person)
        return self._cells

    def _cells_of(self, marked: Flags) -> ShownCells:
        """The cells of the marked blocks, those near a person not known yet."""
        block = np.flatnonzero(marked & (self._width > 0)).astype(np.int32)
        start = np.append(0, self._width[block].cumsum()).astype(np.int32)
        in_volume, others = np.empty(start[-1], np.int32), self.sets.size.astype(float)
        near_person = np.empty(len(in_volume) + len(others), np.int32)
        near_person[len(in_volume) :] = -1
        cells = ShownCells(block, start, self._first[block], in_volume, others, near_person)
        _fill_cells(cells, self.in_volume, self.sets.of_cell)
        return cells


@part
def adjacent_cells(cells: ShownCells, block: int) -> tuple[slice, slice, int]:
    """The cells of a block and of those behind it as far as they lie side by side, as listed and among all.

    And the first block behind these.
    """
    stop, first = block + 1, cells.first[block]
    while stop < len(cells.block) and cells.first[stop] - cells.start[stop] == first - cells.start[block]:
        stop += 1
    listed = slice(cells.start[block], cells.start[stop])
    return listed, slice(first, first + cells.start[stop] - cells.start[block]), stop


@kernel
def _fill_cells(cells: ShownCells, in_volume: Labels, of_cell: Labels) -> None:
    """Fill the indices in the volume, from those (cell,) of all, and take what is listed off the numbers of others."""
    b = 0
    while b < len(cells.block):
        listed, every, b = adjacent_cells(cells, b)
        target, source, cell = cells.in_volume[listed], in_volume[every], of_cell[every]
        for k in range(len(target)):
            target[k] = source[k]
            cells.others[cell[k]] -= 1


@kernel
def _fill_near(cells: ShownCells, place: Labels, near_person: Ints) -> None:
    """Fill the person near each cell listed, from that near each place (place,)."""
    b = 0
    while b < len(cells.block):
        listed, every, b = adjacent_cells(cells, b)
        target, source = cells.near_person[listed], place[every]
        for k in range(len(target)):
            target[k] = near_person[source[k]]


@kernel
def mark_map(reach: Reach, table: SumTable, marked: Flags) -> None:
    """Mark the blocks (block,) with a level of a view's map above its lowest in their boxes."""
    for b in range(len(marked)):
        left, top, right, bottom = reach[b]
        if right > 0 and not marked[b]:
            pixels = (np.int64(right) - left) * (np.int64(bottom) - top)
            u, v = left - table.left, top - table.top
            total = sum_of(table.sums, u, v, right - table.left, bottom - table.top)
            marked[b] = pixels > _MOST_PIXELS or total != table.lowest * pixels


def _reach(footprint: Footprints, start: Ints) -> Reach:
    """The boxes around the footprints (cell, 4) of a view's blocks, whose first cells are start (block,)."""
    first, extent = footprint[:, :2], footprint[:, 2:]
    visible = extent[:, :1] > 0
    low = np.minimum.reduceat(np.where(visible, first, np.iinfo(np.int16).max), start)
    high = np.maximum.reduceat(np.where(visible, first + extent, 0), start)
    return np.where(high[:, :1] > 0, np.concatenate([low, high], -1), 0).astype(np.int16)
