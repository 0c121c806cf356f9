"""The exact two-label minimum cut of a window. The one module that knows the solver."""

from __future__ import annotations

from dataclasses import dataclass

import maxflow
import numpy as np

from stseg.arrays import Flags
from stseg.segmentation.energy import Energy
from stseg.segmentation.reduction import reduce


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


def minimum_cut(energy: Energy) -> Cut:
    """The labelling of least energy; of several, the one with the smallest object set."""
    left = reduce(energy)
    occupied = left.occupied.copy()
    cells = np.flatnonzero(left.open)
    if len(cells):
        node_of = np.full(len(left.open), -1, np.int64)
        node_of[cells] = np.arange(len(cells))
        graph = maxflow.GraphInt(len(cells), len(left.start))
        nodes = graph.add_nodes(len(cells))
        unary = left.unary[cells]
        graph.add_grid_tedges(nodes, (-unary).clip(0), unary.clip(0))
        if len(left.start):
            graph.add_edges(node_of[left.start], node_of[left.end], left.capacity, left.capacity)
        graph.maxflow()
        # The solver counts a node that neither terminal reaches to the source. With the background there, the cells
        # that remain are those from which the sink can be reached: the smallest object set.
        occupied[cells] = graph.get_grid_segments(nodes)
    return Cut(occupied.reshape(energy.unary.shape), len(cells))
