"""Whose the occupied cells are, frame by frame: one blob a track, measured."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import label as connected

from stseg.arrays import Floats, Ints, Labels, Singles
from stseg.geometry import Grid
from stseg.model.blobs import UNASSIGNED, Blobs

_EIGHT = np.ones((3, 3), int)
_FAINT = 1e-6
"""Mass of a cell without evidence, nats."""


def find_blobs(
    label: Labels, log_odds: Singles, people_ground: Floats, people_track: Ints, reach: float, grid: Grid
) -> Blobs:
    """Blobs of one frame.

    The cells of one track are one blob; those of strangers one for each connected piece of ground. A ground cell above
    which several have cells goes to the one with the most mass there.

    Parameters
    ----------
    label : int32 (plane, y, x)
        Whose each cell is: a track, UNASSIGNED, or 0 for background.
    log_odds : float32 (plane, y, x)
        u, nats.
    people_ground, people_track : float64 (n, 2), int64 (n,)
        People of the frame's pass, metres, and their tracks.
    reach
        How far from a person's place their cells reach, metres. A blob holds the person of its track who stands in it:
        who has a cell of it within half a reach.
    """
    owner = _owner(label, log_odds)
    strange, number = connected(owner == UNASSIGNED, _EIGHT)
    known = np.unique(owner[owner > 0])
    cells = np.where(owner > 0, 1 + np.searchsorted(known, owner), 0).astype(np.int32)
    cells[strange > 0] = len(known) + strange[strange > 0]
    track = np.concatenate([known, np.full(number, UNASSIGNED)]).astype(np.int64)
    person = np.full(len(track), -1, np.int64)
    ground = grid.ground
    for j, (place, name) in enumerate(zip(people_ground, people_track, strict=True)):
        away = np.hypot(*(ground[owner == name] - place).T)
        if away.min(initial=np.inf) <= reach / 2:
            person[known.searchsorted(name)] = j
    return _measure(cells, track, person, label, log_odds, grid)


def _owner(label: Labels, log_odds: Singles) -> Labels:
    """The label that has the most mass above each ground cell, int32 (y, x); 0 where none has any."""
    names = np.unique(label[label != 0])
    owner, most = np.zeros(label.shape[1:], np.int32), np.zeros(label.shape[1:])
    strength = np.nan_to_num(log_odds).clip(0) + _FAINT
    for name in names:
        mass = np.where(label == name, strength, 0.0).sum(0)
        owner[mass > most] = name
        np.maximum(most, mass, out=most)
    return owner


def _measure(cells: Labels, track: Ints, person: Ints, label: Labels, log_odds: Singles, grid: Grid) -> Blobs:
    n, everywhere = len(track), grid.ground
    occupied = label == np.append(0, track)[cells]
    occupied &= label != 0
    strength = np.where(occupied, np.nan_to_num(log_odds), 0.0)
    weight = strength.clip(0).sum(0) + _FAINT
    ground, covariance = np.zeros((n, 2)), np.zeros((n, 2, 2))
    extent, height, mass = np.zeros(n), np.zeros(n), np.zeros(n)
    for b in range(n):
        inside = cells == b + 1
        share = weight[inside] / weight[inside].sum()
        places = everywhere[inside]
        ground[b] = share @ places
        spread = places - ground[b]
        covariance[b] = (spread * share[:, None]).T @ spread / max(inside.sum(), 1) + np.eye(2) * grid.cell**2 / 12
        extent[b] = inside.sum() * grid.cell**2
        planes = occupied[:, inside].any(1)
        height[b] = grid.heights[np.flatnonzero(planes)[-1]]
        mass[b] = strength[:, inside].sum() / max(occupied[:, inside].sum(), 1)
    return Blobs(cells, track, person, ground, covariance, extent, height, mass, _touches(cells))


def _touches(cells: Labels) -> Ints:
    """Pairs of blobs, counted from 0, that share one connected piece of ground, int64 (k, 2)."""
    piece = connected(cells > 0, _EIGHT)[0]
    members = np.unique(np.stack([piece[cells > 0], cells[cells > 0] - 1]), axis=1).T
    pairs = {(int(a), int(b)) for i, a in members for j, b in members if i == j and a < b}
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)
