"""What the cut calls occupied, frame by frame: one blob a person, touching people divided between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label as connected

from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.geometry import Grid

_EIGHT = np.ones((3, 3), int)


@dataclass(frozen=True)
class Blobs:
    """The blobs of one frame.

    Attributes
    ----------
    cells : int32 (y, x)
        Blob of each ground cell, counted from 1; 0 for none.
    person : int64 (n,)
        The person of the frame's pass whom each blob holds, -1 for nobody.
    ground : float64 (n, 2)
        Centroid of the likelihood-weighted mass, metres.
    covariance : float64 (n, 2, 2)
        Square metres.
    extent : float64 (n,)
        Ground area, square metres.
    height : float64 (n,)
        Height of the uppermost occupied plane, metres.
    mass : float64 (n,)
        Mean log-odds of the occupied cells, nats.
    touches : int64 (k, 2)
        Pairs of blobs (counted from 0) that share one connected piece of ground.
    """

    cells: Labels
    person: Ints
    ground: Floats
    covariance: Floats
    extent: Floats
    height: Floats
    mass: Floats
    touches: Ints


def find_blobs(occupied: Flags, log_odds: Singles, people_ground: Floats, reach: float, grid: Grid) -> Blobs:
    """Blobs of one frame of the cut.

    Each connected piece of ground goes to the people who stand in it, cell by cell to the nearest; a piece in which
    nobody stands is a blob of its own: the cut may see what a single frame's pass did not.

    Parameters
    ----------
    occupied : bool (plane, y, x)
        The cut's label.
    log_odds : float32 (plane, y, x)
        u, nats.
    people_ground : float64 (n, 2)
        People of the frame's pass, metres.
    reach
        How far from a person's place their cells reach, metres.
    """
    pieces, number = connected(occupied.any(0), _EIGHT)
    cells = np.zeros(pieces.shape, np.int32)
    person: list[int] = []
    piece_of: list[int] = []
    ground = grid.ground
    home = _homes(np.asarray(pieces, np.int32), people_ground, reach, grid)
    for piece in range(1, number + 1):
        inside = pieces == piece
        standing = np.flatnonzero(home == piece)
        if len(standing) == 0:
            person.append(-1)
            cells[inside] = len(person)
            piece_of.append(piece)
            continue
        nearest = np.hypot(*np.moveaxis(ground[inside][:, None] - people_ground[standing], -1, 0)).argmin(1)
        taken = np.unique(nearest)
        cells[inside] = len(person) + 1 + np.searchsorted(taken, nearest)
        person.extend(standing[taken])
        piece_of.extend([piece] * len(taken))
    return _measure(cells, np.array(person, np.int64), np.array(piece_of), occupied, log_odds, grid)


def _homes(pieces: Labels, people_ground: Floats, reach: float, grid: Grid) -> Ints:
    """The piece in which each person stands: the one with the nearest cell within half a reach; 0 for none."""
    home = np.zeros(len(people_ground), np.int64)
    rows, columns = np.nonzero(pieces)
    if len(rows):
        places = grid.ground[rows, columns]
        for j, place in enumerate(people_ground):
            away = np.hypot(*(places - place).T)
            if away.min() <= reach / 2:
                home[j] = pieces[rows[away.argmin()], columns[away.argmin()]]
    return home


def _measure(cells: Labels, person: Ints, piece_of: Ints, occupied: Flags, log_odds: Singles, grid: Grid) -> Blobs:
    n = len(person)
    strength = np.where(occupied, np.nan_to_num(log_odds), 0.0)
    weight = strength.clip(0).sum(0) + 1e-6
    ground, covariance = np.zeros((n, 2)), np.zeros((n, 2, 2))
    extent, height, mass = np.zeros(n), np.zeros(n), np.zeros(n)
    for b in range(n):
        inside = cells == b + 1
        share = weight[inside] / weight[inside].sum()
        places = grid.ground[inside]
        ground[b] = share @ places
        spread = places - ground[b]
        covariance[b] = (spread * share[:, None]).T @ spread / max(inside.sum(), 1) + np.eye(2) * grid.cell**2 / 12
        extent[b] = inside.sum() * grid.cell**2
        planes = occupied[:, inside].any(1)
        height[b] = grid.heights[np.flatnonzero(planes)[-1]]
        mass[b] = strength[:, inside].sum() / max(occupied[:, inside].sum(), 1)
    pairs = [(a, b) for a in range(n) for b in range(a + 1, n) if piece_of[a] == piece_of[b]]
    touches = np.array(pairs, np.int64).reshape(-1, 2)
    return Blobs(cells, person, ground, covariance, extent, height, mass, touches)
