"""Cells whose label is certain before any cut: exact persistency.

A cell whose unary outweighs all its capacities together takes the side of its unary in some minimum whatever the others
do. It leaves the graph; its edges become terminal capacities of the neighbours that stay, which may decide those too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.segmentation.energy import Energy, time_edges

_ROUNDS = 3


@dataclass(frozen=True)
class Reduced:
    """What is left to cut.

    Attributes
    ----------
    occupied : bool (n,)
        Label of each cell of the flattened volume; means nothing where `open` is true.
    open : bool (n,)
        Cells that are still to be decided.
    unary : int64 (n,)
        Quanta, with the capacities to decided neighbours added.
    start, end, capacity : int64 (edge,)
        Edges between open cells.
    """

    occupied: Flags
    open: Flags
    unary: Ints
    start: Ints
    end: Ints
    capacity: Ints


def edges(energy: Energy) -> tuple[Ints, Ints, Ints]:
    """All edges of the window as flat indices of their cells, and their capacities in quanta."""
    index = np.arange(energy.unary.size).reshape(energy.unary.shape)
    pairs = [
        (index[:, :-1].ravel(), index[:, 1:].ravel(), energy.up),
        (index[:, :, :-1].ravel(), index[:, :, 1:].ravel(), energy.across),
        (index[..., :-1].ravel(), index[..., 1:].ravel(), energy.along),
        (*time_edges(energy), energy.ahead),
    ]
    start, end = np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs])
    capacity = np.concatenate([np.full(len(p[0]), p[2], np.int64) for p in pairs])
    return start, end, capacity


def reduce(energy: Energy) -> Reduced:
    """Decide what can be decided without a cut."""
    start, end, capacity = edges(energy)
    unary = energy.unary.ravel().copy()
    size = len(unary)
    open_, occupied = np.ones(size, bool), np.zeros(size, bool)
    for _ in range(_ROUNDS):
        around = np.bincount(start, capacity, size) + np.bincount(end, capacity, size)
        # Of several minima the smallest object set is wanted, so a tie decides for the background only.
        sure = open_ & ((unary <= -around) | (unary > around))
        if not sure.any():
            break
        occupied[sure] = unary[sure] > 0
        open_[sure] = False
        leaving = sure[start] != sure[end]
        inner = np.where(sure[start], end, start)[leaving]
        outer = np.where(sure[start], start, end)[leaving]
        signed = np.where(occupied[outer], capacity[leaving], -capacity[leaving])
        unary += np.bincount(inner, signed, size).astype(np.int64)
        kept = ~(sure[start] | sure[end])
        start, end, capacity = start[kept], end[kept], capacity[kept]
    return Reduced(occupied, open_, unary, start, end, capacity)
