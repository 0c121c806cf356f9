"""Residual graphs: their arcs are listed, stand in equal rows, or are computed from the layout of a window.

One search serves all three. Which branch a kernel takes is known when it is compiled, since None is a type of its own.
"""

from __future__ import annotations

from typing import NamedTuple

from stseg.accelerate import part
from stseg.arrays import AnyArray, Labels
from stseg.graphcut.lattice import Lattice, neighbour


class Graph(NamedTuple):
    """A residual graph.

    Attributes
    ----------
    residual : int16 or int32 (arc,)
        What each arc can still carry; the arcs of a node follow each other.
    excess : int32 (n,)
        What each node can still take from the source (> 0) or give to the sink (< 0).
    degree
        Arcs of each node, where they stand in equal rows; they lead back in pairs 2 i, 2 i + 1.
    first, sister : int32 (n + 1,), (arc,), or None
        The first arc of each node and the arc that leads back, where there are no such rows.
    head : int32 (arc,), or None
        The node that an arc leads to; an arc that leads nowhere, and carries nothing, leads to its own node.
    lattice
        Where arcs lead, if it is computed.
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
    """The first arc of a node; that of the next node is past its last."""
    if first is None:
        return node * degree
    return int(first[node])


@part
def head_of(arc: int, node: int, head: Labels | None, degree: int, lattice: Lattice | None) -> int:
    """The node that a node's arc leads to."""
    if lattice is not None:
        return neighbour(node, arc - node * degree, lattice)
    assert head is not None
    return int(head[arc])


@part
def sister_of(arc: int, node: int, to: int, sister: Labels | None, degree: int) -> int:
    """The arc that leads back."""
    if sister is None:
        return to * degree + ((arc - node * degree) ^ 1)
    return int(sister[arc])
