"""Energy of a binary labelling of a space-time grid: unary and pairwise terms in integer quanta.

    E(l) = sum_p D_p(l_p) + sum_(p,q) B_pq [l_p != l_q],   D_p(1) - D_p(0) = -u(p)

Neighbours differ by one of a set of offsets (time, plane, y, x); edges in time follow a map of the cells of one frame's
y-x plane to those of the next. All terms are integer multiples of one quantum, so that energies compare exactly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stseg.arrays import AnyArray, Bytes, Flags, Ints, Labels
from stseg.graphcut.lattice import Lattice, lattice_of, neighbour, node_values
from stseg.graphcut.sign_sets import GUARD, SignSets, sign_sets
from stseg.kernels.accelerate import kernel

QUANTUM = 1e-3
"""One unit of capacity, nats."""


@dataclass(frozen=True)
class GridEnergy:
    """Unary and pairwise terms, quanta."""

    unary: Labels
    """int32 (time, plane, y, x): u, gain of label 1 over label 0, quanta."""
    offsets: Ints
    """int64 (k, 4): one offset (time, plane, y, x) of each opposite pair of neighbours: those within a frame, then
    those in time."""
    capacity: Labels
    """int32 (k,): B, cost of different labels at each offset, quanta."""
    successor: Labels
    """int32 (time - 1, y, x): cell (y columns + x) of the next frame to which each cell's edges in time lead; -1 for
    none. Injective."""
    present: Flags | None = None
    """bool (y, x), or None: where there are cells, in all frames and planes: others have no edges, and label 0. None
    for everywhere."""

    @cached_property
    def lattice(self) -> Lattice:
        """Numbering of the cells, and their neighbours."""
        return lattice_of(self.unary.shape, self.offsets, self.successor)

    @cached_property
    def signs(self) -> SignSets:
        """The sets of cells labelled by their sign."""
        return sign_sets(self.unary, self.lattice, self.capacity, self.present)

    def node_values(self, values: AnyArray) -> AnyArray:
        """Values of cells (time, plane, y, x) at their nodes, 0 at guards and where there is no cell; (node,)."""
        present = values if self.present is None else np.where(self.present, values, np.zeros(1, values.dtype))
        return node_values(present)

    def of(self, labels: Labels | Flags) -> int:
        """Energy of a labelling (time, plane, y, x) relative to all 0; labels bool or 0 / 1."""
        occupied = labels != 0
        return int(_energy(self.unary, occupied, node_values(occupied), self.signs.state, self.lattice, self.capacity))

    def edge_values(self, volume: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
        """Values of a volume (time, plane, y, x) at both ends of all edges, offset by offset."""
        for time, plane, y, x in self.offsets.tolist():
            start, end = _overlap((plane, y, x))
            if time == 0:
                yield volume[:, *start], volume[:, *end]
            else:
                below, above = volume[:-1, start[0]], volume[1:, end[0]]
                to = _shifted(self.successor, y, x)
                frames, rows, columns = np.nonzero(to >= 0)
                flat = above.reshape(*above.shape[:2], to.shape[1] * to.shape[2])
                yield below[frames, :, rows, columns], flat[frames, :, to[frames, rows, columns]]

    def edges(self) -> tuple[Ints, Ints, Ints]:
        """All edges: flat cell indices of both ends and capacities, int64 (edge,) each."""
        index = np.arange(self.unary.size).reshape(self.unary.shape)
        starts, edge_values = zip(
            *((start.ravel(), end.ravel()) for start, end in self.edge_values(index)), strict=True
        )
        capacity = np.repeat(self.capacity.astype(np.int64), [len(start) for start in starts])
        return np.concatenate(starts), np.concatenate(edge_values), capacity


@kernel
def _energy(unary: Labels, occupied: Flags, at_node: Flags, sign: Bytes, lattice: Lattice, capacity: Labels) -> int:
    """Energy of the occupied cells (time, plane, y, x), at_node (node,); `sign` (node,) knows the guards."""
    frames, planes, rows, columns = unary.shape
    total = 0
    for t in range(frames):
        for p in range(planes):
            for y in range(rows):
                first = ((t * (planes + 1) + p + 1) * (rows + 1) + y + 1) * (columns + 1) + 1
                for x in range(columns):
                    if occupied[t, p, y, x]:
                        total -= unary[t, p, y, x]
                        for slot in range(2 * len(capacity)):
                            to = neighbour(first + x, slot, lattice)
                            if sign[to] != GUARD and not at_node[to]:
                                total += capacity[slot // 2]
    return total


def _overlap(offset: tuple[int, ...]) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Slices of a frame that hold the first and the second cell of all pairs at an offset."""
    start = tuple(slice(max(-step, 0), -step if step > 0 else None) for step in offset)
    end = tuple(slice(max(step, 0), step if step < 0 else None) for step in offset)
    return start, end


def _shifted(successor: Labels, y: int, x: int) -> Labels:
    """Cells at an offset (y, x) from the successors; -1 for none."""
    rows, columns = successor.shape[1:]
    to_y, to_x = successor // columns + y, successor % columns + x
    kept = (successor >= 0) & (to_y >= 0) & (to_y < rows) & (to_x >= 0) & (to_x < columns)
    return np.where(kept, to_y * columns + to_x, -1)
