"""Residual graphs: their arcs are listed, stand in equal rows, or are computed from the layout of a window.

One search serves all three. Which branch a kernel takes is known when it is compiled, since None is a type of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import AnyArray, Labels


class Lattice(NamedTuple):
    """How nodes of a window are numbered, and where their arcs lead.

    The first plane of a frame, the first row of a plane and the first cell of a row are guards and no cells: whoever
    steps off the grid lands on one of them, at either end.

    Attributes
    ----------
    steps : int32 (degree,)
        What each arc adds to a node's number within a frame; arcs lead back in pairs 2 i, 2 i + 1.
    ahead, behind : int32 (frames + 1, plane)
        What following the motion of a ground cell adds to a node's number, to the next frame and to the one before;
        0 where it leads nowhere.
    near
        Arcs within a frame; those after it lead ahead (even) and behind (odd).
    plane, frame
        Nodes of a plane and of a frame, guards included.
    """

    steps: Labels
    ahead: Labels
    behind: Labels
    near: int
    plane: int
    frame: int


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


@kernel
def first_arc(node: int, first: Labels | None, degree: int) -> int:
    """The first arc of a node; that of the next node is past its last."""
    if first is None:
        return node * degree
    return np.int64(first[node])


@kernel
def head_of(arc: int, node: int, head: Labels | None, degree: int, lattice: Lattice | None) -> int:
    """The node that a node's arc leads to."""
    if lattice is None:
        return np.int64(head[arc])
    return neighbour(node, arc - node * degree, lattice)


@kernel
def sister_of(arc: int, node: int, to: int, sister: Labels | None, degree: int) -> int:
    """The arc that leads back."""
    if sister is None:
        return to * degree + ((arc - node * degree) ^ 1)
    return np.int64(sister[arc])


@kernel
def neighbour(node: int, slot: int, lattice: Lattice) -> int:
    """The node that an arc leads to; 0, a guard, for an arc in time that leads nowhere."""
    step = lattice.steps[slot]
    if slot < lattice.near:
        return node + step
    if slot & 1:
        node += step
        leap = lattice.behind[node // lattice.frame, node % lattice.plane]
        return node + leap if leap != 0 else 0
    leap = lattice.ahead[node // lattice.frame, node % lattice.plane]
    return node + leap + step if leap != 0 else 0
