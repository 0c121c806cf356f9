"""Residual graphs: arcs in lists, in rows of equal length, or computed from a grid.

One search serves all three. A kernel's branch is chosen when it is compiled, since None has a type of its own.
"""

from __future__ import annotations

from typing import NamedTuple

from stseg.arrays import AnyArray, Labels
from stseg.graphcut.lattice import Lattice, neighbour
from stseg.kernels.accelerate import part


class Graph(NamedTuple):
    """A residual graph.

    Attributes
    ----------
    residual : int16 or int32 (arc,)
        Residual capacities (n-links); the arcs of a node are consecutive.
    excess : int32 (n,)
        Residual capacity of each t-link: from the source (> 0) or to the sink (< 0).
    degree
        Arcs of each node, where rows have equal length; slots 2 i and 2 i + 1 are opposite.
    first, sister : int32 (n + 1,), (arc,), or None
        First arc of each node and the reverse arc of each arc, where rows differ in length.
    head : int32 (arc,), or None
        Node at the end of each arc; an arc off the graph has capacity 0 and ends at its own node.
    lattice
        Grid from which ends of arcs are computed, or None.
    """

    residual: AnyArray
    excess: Labels
    degree: int
    first: Labels | None
    sister: Labels | None
    head: Labels | None
    lattice: Lattice | None


@part
def first_arc(node: int, first: Labels | None, degree: int) -> int:
    """First arc of a node; that of the next node is past its last."""
    if first is None:
        return node * degree
    return int(first[node])


@part
def head_of(arc: int, node: int, head: Labels | None, degree: int, lattice: Lattice | None) -> int:
    """Node at the end of an arc."""
    if lattice is not None:
        return neighbour(node, arc - node * degree, lattice)
    assert head is not None
    return int(head[arc])


@part
def sister_of(arc: int, node: int, to: int, sister: Labels | None, degree: int) -> int:
    """Reverse arc of an arc."""
    if sister is None:
        return to * degree + ((arc - node * degree) ^ 1)
    return int(sister[arc])
