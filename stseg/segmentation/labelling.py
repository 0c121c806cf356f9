"""Whose each occupied cell of a window is.

A connected piece of the cut's object in which one person stands is theirs. A piece in which several stand, at whatever
frame, is divided by an expansion over the background, the tracks that are expected in this window, and a stranger. What
the two-label cut calls background stays background, exactly: no label of a cell is worth more than u, and the smallest
object of the greater gains holds every object of the smaller ones. So the pieces are all that need be moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Labels
from stseg.geometry import Grid
from stseg.graphcut.cell_subset import CellSubset, subset
from stseg.graphcut.energy import Energy
from stseg.graphcut.expansion import expand
from stseg.model.blobs import UNASSIGNED
from stseg.model.predicted_places import PredictedPlaces
from stseg.segmentation.unary import BodyShape, label_energy, shares


@dataclass(frozen=True)
class WindowDetections:
    """Whom the passes of a window's frames found.

    Attributes
    ----------
    ground : float64 (n, 2) for each frame
        Metres.
    track : int64 (n,) for each frame
        Who they are.
    """

    ground: Sequence[Floats]
    track: Sequence[Ints]


@dataclass(frozen=True)
class WindowLabels:
    """The labels of a window.

    Attributes
    ----------
    label : int32 (time, plane, y, x)
        Track of each cell, UNASSIGNED where it is nobody's known, 0 for background.
    cells
        Number of cells that were divided by an expansion; 0 where nobody touches.
    """

    label: Labels
    cells: int


def label_cells(
    energy: Energy, occupied: Flags, found: WindowDetections, places: PredictedPlaces, pillar: BodyShape, grid: Grid
) -> WindowLabels:
    """Give every occupied cell to a track or to a stranger.

    Parameters
    ----------
    energy, occupied
        Of the window, and its minimum cut, bool (time, plane, y, x).
    found
        The people of its frames; their tracks are all among the places.
    """
    part = subset(energy, occupied)
    if not len(part.cell):
        return WindowLabels(np.zeros(occupied.shape, np.int32), 0)
    piece = part.components()
    stands, elsewhere = _who_stands(part, piece, occupied, found, places, pillar.reach, grid)
    number = stands.sum(1)
    names = np.append(places.track, UNASSIGNED)
    labels = names[np.where(number == 1, np.argmax(np.column_stack([stands, number != 1]), 1), -1)][piece]
    touching = number[piece] > 1
    if touching.any():
        here = replace(places, expected=places.expected & ~elsewhere)
        labels[touching] = _divided(energy, part.only(touching), here, pillar, grid)
    label = np.zeros(occupied.shape, np.int32)
    label.flat[part.cell] = labels
    return WindowLabels(label, int(touching.sum()))


def _divided(energy: Energy, part: CellSubset, places: PredictedPlaces, pillar: BodyShape, grid: Grid) -> Ints:
    """The track of each of a part's cells, UNASSIGNED or 0, int64 (n,)."""
    frame, plane, y, x = np.unravel_index(part.cell, energy.unary.shape)
    share = shares(frame, grid.ground[y, x], grid.heights[plane], places, pillar)
    problem = label_energy(energy.unary.ravel()[part.cell], share, part)
    names = np.concatenate([[0], places.track, [UNASSIGNED]])
    return np.asarray(names[expand(problem, problem.cheapest_labels())])


def _who_stands(
    part: CellSubset,
    piece: Ints,
    occupied: Flags,
    found: WindowDetections,
    places: PredictedPlaces,
    reach: float,
    grid: Grid,
) -> tuple[Flags, Flags]:
    """Which tracks stand in which connected piece at some frame, and which were seen off all of them.

    Somebody stands in what is occupied above the nearest occupied ground cell within half a reach.

    Returns
    -------
    bool (piece, k), bool (time, k)
    """
    stands = np.zeros((int(piece.max()) + 1, len(places.track)), bool)
    elsewhere = np.zeros_like(places.expected)
    volume = np.full(occupied.shape, -1, np.int64)
    volume.flat[part.cell] = piece
    everywhere = grid.ground
    for t, (ground, track) in enumerate(zip(found.ground, found.track, strict=True)):
        rows, columns = np.nonzero(occupied[t].any(0))
        cells_ground = everywhere[rows, columns]
        for place, k in zip(ground, np.searchsorted(places.track, track), strict=True):
            away = np.hypot(*(cells_ground - place).T)
            if away.min(initial=np.inf) > reach / 2:
                elsewhere[t, k] = True
                continue
            above = volume[t, :, rows[away.argmin()], columns[away.argmin()]]
            stands[above[above >= 0], k] = True
    return stands, elsewhere
