"""The two solvers by name, and minimum cuts by PyMaxflow (Boykov and Kolmogorov's own code), an independent check.

Both return the smallest source set, so their labels are equal bit for bit. PyMaxflow counts a node that no residual arc
joins to either terminal to the source; here its source stands for label 0, so that label 1 has the smallest set.
"""

from collections.abc import Callable
from typing import NamedTuple

import maxflow
import numpy as np

from stseg.arrays import Flags, Ints, Labels
from stseg.graphcut.cut import Cut, minimum_cut
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.sparse import CAPACITY_LIMIT, sparse_cut
from stseg.kernels.accelerate import COMPILED


class Solver(NamedTuple):
    """Minimum cuts of grids, and of lists of edges for expansion moves."""

    grid: Callable[[GridEnergy], Cut]
    sparse: Callable[..., Flags]


def _pymaxflow_grid_cut(energy: GridEnergy) -> Cut:
    """Minimum cut of a grid, as `stseg.graphcut.cut.minimum_cut`: every cell is a node, none is decided before."""
    size = energy.unary.size
    graph = maxflow.GraphInt(size, size * len(energy.offsets))
    nodes = graph.add_grid_nodes(energy.unary.shape)
    straight = _keeps_its_cells(energy)
    for offset, capacity, (start, end) in zip(energy.offsets, energy.capacity, energy.edge_values(nodes), strict=True):
        if offset[0] == 0 or straight:
            structure = np.zeros((3, 3, 3, 3))
            structure[tuple(offset + 1)] = 1
            graph.add_grid_edges(nodes, int(capacity), structure, symmetric=True)
        else:
            graph.add_edges(start.ravel(), end.ravel(), *np.full((2, start.size), capacity, np.int64))
    graph.add_grid_tedges(nodes, (-energy.unary).clip(0), energy.unary.clip(0))
    graph.maxflow()
    return Cut(np.asarray(graph.get_grid_segments(nodes)), size)


def _pymaxflow_sparse_cut(
    unary: Ints, start: Ints | Labels, end: Ints | Labels, forward: Ints | Labels, backward: Ints | Labels
) -> Flags:
    """Minimum cut of a list of edges, as `stseg.graphcut.sparse.sparse_cut`."""
    graph = maxflow.GraphInt(len(unary), len(start))
    nodes = graph.add_nodes(len(unary))
    gain = unary.clip(-CAPACITY_LIMIT - 1, CAPACITY_LIMIT + 1)
    graph.add_grid_tedges(nodes, (-gain).clip(0), gain.clip(0))
    graph.add_edges(*(np.asarray(part, np.int64) for part in (start, end, backward, forward)))
    graph.maxflow()
    return np.asarray(graph.get_grid_segments(nodes))


def _keeps_its_cells(energy: GridEnergy) -> bool:
    """Whether every edge in time joins a cell to itself: such edges PyMaxflow adds faster as a grid."""
    rows, columns = energy.successor.shape[1:]
    still = np.arange(rows * columns).reshape(rows, columns)
    return bool((energy.successor == still).all())


SOLVERS = {"stseg": Solver(minimum_cut, sparse_cut), "pymaxflow": Solver(_pymaxflow_grid_cut, _pymaxflow_sparse_cut)}
"""Their labels are equal bit for bit."""


def find_solver(name: str) -> Solver:
    """Solver of that name; PyMaxflow where kernels are not compiled, as plain Python would take hours."""
    return SOLVERS[name if COMPILED else "pymaxflow"]
