"""Exact minimum cut of the binary energy of a space-time grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Bytes, Flags, Labels
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.lattice import Lattice, cells, neighbour
from stseg.graphcut.max_flow import Graph, solve
from stseg.graphcut.reduction import Reduction, reduce
from stseg.graphcut.sign_sets import LABEL_ONE, UNDECIDED
from stseg.kernels.accelerate import kernel

GREATEST_CAPACITY = 16383
"""Quanta: twice as much fits into 16 bits."""


@dataclass(frozen=True)
class Cut:
    """A minimum cut.

    Attributes
    ----------
    occupied : bool (time, plane, y, x)
        Cells with label 1.
    nodes
        Number of cells that the reduction left undecided.
    """

    occupied: Flags
    nodes: int


def minimum_cut(energy: GridEnergy) -> Cut:
    """Labelling of least energy; of several, the one with the fewest cells of label 1.

    Parameters
    ----------
    energy
        Capacities of at most 16383 quanta each, and at most 2**30 together.

    Raises
    ------
    OverflowError
        If a capacity is too large.
    """
    if energy.capacity.max(initial=0) > GREATEST_CAPACITY:
        raise OverflowError(f"a capacity of {energy.capacity.max()} quanta, more than {GREATEST_CAPACITY}")
    reduced = reduce(energy)
    if len(reduced.left):
        reduced.state[reduced.left[solve(_residual_graph(reduced))]] = LABEL_ONE
    return Cut(np.asarray(cells(reduced.state, energy.unary.shape) == LABEL_ONE), len(reduced.left))


def _residual_graph(reduced: Reduction) -> Graph:
    """Graph of the undecided nodes, renumbered; arcs off the graph have capacity 0 and end at their own node."""
    size, degree = len(reduced.left), len(reduced.capacity)
    number = np.empty(len(reduced.state), np.int32)
    number[reduced.left] = np.arange(size, dtype=np.int32)
    head, sister = np.empty((2, size * degree), np.int32)
    residual, first = np.empty(size * degree, np.int16), np.arange(size + 1, dtype=np.int32) * np.int32(degree)
    _fill_arcs(reduced.left, reduced.state, reduced.lattice, reduced.capacity, number, head, sister, residual)
    return Graph(residual, reduced.excess.copy(), first, sister, head)


@kernel
def _fill_arcs(
    left: Labels, state: Bytes, lattice: Lattice, capacity: Labels, number: Labels, head: Labels, sister: Labels,
    residual: AnyArray,
) -> None:  # fmt: skip
    """Fill head, sister and residual of the arcs of the undecided nodes; slots 2 i and 2 i + 1 are opposite."""
    degree = len(capacity)
    for k, node in enumerate(left):
        for slot in range(degree):
            arc, to = k * degree + slot, neighbour(node, slot, lattice)
            head[arc], sister[arc], residual[arc] = k, arc, 0
            if state[to] == UNDECIDED:
                head[arc], sister[arc] = number[to], number[to] * degree + (slot ^ 1)
                residual[arc] = capacity[slot]
