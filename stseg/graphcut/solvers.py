"""The two solvers, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from stseg.arrays import Flags
from stseg.graphcut import pymaxflow
from stseg.graphcut.cut import Cut, minimum_cut
from stseg.graphcut.grid_energy import GridEnergy
from stseg.graphcut.sparse import sparse_cut
from stseg.kernels.accelerate import COMPILED


class Solver(NamedTuple):
    """Minimum cuts of grids, and of lists of edges for expansion moves."""

    grid: Callable[[GridEnergy], Cut]
    sparse: Callable[..., Flags]


SOLVERS = {
    "stseg": Solver(minimum_cut, sparse_cut),
    "pymaxflow": Solver(pymaxflow.grid_cut, pymaxflow.sparse_cut),
}
"""Their labels are equal bit for bit."""


def find_solver(name: str) -> Solver:
    """Solver of that name; PyMaxflow where kernels are not compiled, as plain Python would take hours."""
    return SOLVERS[name if COMPILED else "pymaxflow"]
