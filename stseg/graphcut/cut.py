"""Exact minimum cut of the binary energy of a space-time grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags
from stseg.graphcut.arcs import in_place, in_rows
from stseg.graphcut.energy import Energy
from stseg.graphcut.graph import Graph
from stseg.graphcut.lattice import cells
from stseg.graphcut.parallel_max_flow import Bridges, solve, solve_halves
from stseg.graphcut.reduction import Reduction, reduce
from stseg.graphcut.sign_sets import OCCUPIED

DENSE = 0.5
"""Share of undecided cells from which the graph is stored in place: renumbered rows would take twice the memory."""
TWO_THREADS = 20_000
"""Undecided nodes from which a second thread gains more time than it costs."""
_MOST = 16383
"""Largest capacity: twice as much fits into 16 bits."""

Storage = Callable[[Reduction, int], tuple[Graph, Bridges]]


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


def minimum_cut(energy: Energy, threads: int = 2, storage: Storage | None = None) -> Cut:
    """Labelling of least energy; of several, the one with the fewest cells of label 1.

    Parameters
    ----------
    energy
        Capacities of at most 16383 quanta each, and at most 2**30 together.
    threads
        1 or 2. The labels do not depend on it.
    storage
        Storage of the undecided graph; chosen by its size if None. The labels do not depend on it.

    Raises
    ------
    OverflowError
        If a capacity is too large.
    """
    if energy.capacity.max(initial=0) > _MOST:
        raise OverflowError(f"a capacity of {energy.capacity.max()} quanta, more than {_MOST}")
    reduced = reduce(energy)
    nodes = len(reduced.left)
    if nodes:
        arrange = storage or (in_place if nodes > DENSE * energy.unary.size else in_rows)
        middle = int(reduced.left[nodes // 2]) // reduced.lattice.frame * reduced.lattice.frame
        if threads == 1 or nodes < TWO_THREADS:
            graph, _ = arrange(reduced, 0)
            reached = solve(graph)
        else:
            reached = solve_halves(*arrange(reduced, middle))
        reduced.state[reduced.left[reached if len(reached) == nodes else reached[reduced.left]]] = OCCUPIED
    return Cut(np.asarray(cells(reduced.state, energy.unary.shape) == OCCUPIED), nodes)
