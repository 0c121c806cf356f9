"""The exact two-label minimum cut of a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags
from stseg.graphcut.arcs import in_place, in_rows
from stseg.graphcut.energy import Energy
from stseg.graphcut.graph import Graph
from stseg.graphcut.halves import Bridges, solve, solve_halves
from stseg.graphcut.lattice import cells
from stseg.graphcut.reduction import OCCUPIED, Reduction, reduce

DENSE = 0.5
"""Share of the cells left by the reduction from which their arcs stay in place: rows would take twice the memory."""
WORTH_TWO = 20_000
"""Open nodes from which a second thread gains more than it costs."""
_STRONGEST = 16383
"""Capacity of which twice fits into 16 bits."""

Storage = Callable[[Reduction, int], tuple[Graph, Bridges]]


@dataclass(frozen=True)
class Cut:
    """A minimum cut.

    Attributes
    ----------
    occupied : bool (time, plane, y, x)
        True where a cell is occupied.
    nodes
        Number of cells that the reduction left to the solver.
    """

    occupied: Flags
    nodes: int


def minimum_cut(energy: Energy, threads: int = 2, storage: Storage | None = None) -> Cut:
    """The labelling of least energy; of several, the one with the smallest object set.

    Parameters
    ----------
    energy
        With capacities of at most 16383 quanta each, and at most 2**30 together.
    threads
        1 or 2; the labels are the same.
    storage
        How the arcs of what is left are stored; by its share if not given. The labels are the same.

    Raises
    ------
    OverflowError
        If a capacity is larger.
    """
    if energy.capacity.max(initial=0) > _STRONGEST:
        raise OverflowError(f"a capacity of {energy.capacity.max()} quanta, more than {_STRONGEST}")
    reduced = reduce(energy)
    nodes = len(reduced.left)
    if nodes:
        arrange = storage or (in_place if nodes > DENSE * energy.unary.size else in_rows)
        middle = int(reduced.left[nodes // 2]) // reduced.lattice.frame * reduced.lattice.frame
        if threads == 1 or nodes < WORTH_TWO:
            graph, _ = arrange(reduced, 0)
            reached = solve(graph)
        else:
            reached = solve_halves(*arrange(reduced, middle))
        reduced.state[reduced.left[reached if len(reached) == nodes else reached[reduced.left]]] = OCCUPIED
    return Cut(np.asarray(cells(reduced.state, energy.unary.shape) == OCCUPIED), nodes)
