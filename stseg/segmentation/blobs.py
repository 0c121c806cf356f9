"""Blobs: ground regions of each track in each frame, with centroid, covariance, extent and height."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import label as connected

from stseg.arrays import Flags, Floats, Ints, Labels, Singles
from stseg.geometry import Grid
from stseg.model.blobs import UNASSIGNED, Blobs

_EIGHT = np.ones((3, 3), int)
_FAINT = 1e-6
"""Mass of a cell without evidence, nats."""


def find_blobs(
    label: Labels, log_odds: Singles, people_ground: Floats, people_track: Ints, reach: float, grid: Grid
) -> Blobs:
    """Blobs of one frame.

    The cells of a track form one blob; unassigned cells one blob for each connected component on the ground. A ground
    cell below cells of several labels goes to the one with the most mass above it. A detection without cells of its own
    is a blob without extent: whether it exists was decided before, and the cut only gives cells to it. Beyond the area,
    where there are no cells to give, it is no blob.

    Parameters
    ----------
    label : int32 (plane, y, x)
        Track of each cell, UNASSIGNED, or 0 for background.
    log_odds : float32 (plane, y, x)
        u, nats.
    people_ground, people_track : float64 (n, 2), int64 (n,)
        Detections of the frame, metres, and their tracks.
    reach
        Reach of a body's cells around its place, metres. A blob holds the detection of its track if one of its cells is
        within half a reach of it.
    """
    ground_label = _ground_labels(label, log_odds)
    unassigned_component, number = connected(ground_label == UNASSIGNED, _EIGHT)
    known = np.unique(ground_label[ground_label > 0])
    cells = np.where(ground_label > 0, 1 + np.searchsorted(known, ground_label), 0).astype(np.int32)
    cells[unassigned_component > 0] = len(known) + unassigned_component[unassigned_component > 0]
    track = np.concatenate([known, np.full(number, UNASSIGNED)]).astype(np.int64)
    person = np.full(len(track), -1, np.int64)
    ground = grid.ground
    for j, (position, track_id) in enumerate(zip(people_ground, people_track, strict=True)):
        distance = np.hypot(*(ground[ground_label == track_id] - position).T)
        if distance.min(initial=np.inf) <= reach / 2:
            person[known.searchsorted(track_id)] = j
    blobs = _measure(cells, track, person, label, log_odds, grid)
    without = np.setdiff1d(np.flatnonzero(_in_volume(people_ground, log_odds, grid)), person)
    return _joined(blobs, without, people_ground[without], people_track[without], grid)


def _in_volume(ground: Floats, log_odds: Singles, grid: Grid) -> Flags:
    """Places (n, 2) above which the volume has a cell that some view sees, bool (n,)."""
    column, row = np.rint(grid.cell_of(ground)).astype(np.int64).T
    rows, columns = log_odds.shape[1:]
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    seen = np.isfinite(log_odds[:, row.clip(0, rows - 1), column.clip(0, columns - 1)]).any(0)
    return np.asarray(inside & seen)


def _joined(blobs: Blobs, person: Ints, ground: Floats, track: Ints, grid: Grid) -> Blobs:
    """Blobs, and behind them detections (n,) as blobs without cells."""
    none, spread = np.zeros(len(person)), np.tile(np.eye(2) * grid.cell**2 / 12, (len(person), 1, 1))
    return replace(
        blobs,
        track=np.append(blobs.track, track),
        person=np.append(blobs.person, person),
        ground=np.concatenate([blobs.ground, ground]),
        covariance=np.concatenate([blobs.covariance, spread]),
        extent=np.append(blobs.extent, none),
        height=np.append(blobs.height, none),
        mass=np.append(blobs.mass, none),
    )


def _ground_labels(label: Labels, log_odds: Singles) -> Labels:
    """Label with the most mass above each ground cell, int32 (y, x); 0 for none."""
    labels = np.unique(label[label != 0])
    ground_label, most = np.zeros(label.shape[1:], np.int32), np.zeros(label.shape[1:])
    strength = np.nan_to_num(log_odds).clip(0) + _FAINT
    for track_id in labels:
        mass = np.where(label == track_id, strength, 0.0).sum(0)
        ground_label[mass > most] = track_id
        np.maximum(most, mass, out=most)
    return ground_label


def _measure(cells: Labels, track: Ints, person: Ints, label: Labels, log_odds: Singles, grid: Grid) -> Blobs:
    n, cell_ground = len(track), grid.ground
    occupied = label == np.append(0, track)[cells]
    occupied &= label != 0
    strength = np.where(occupied, np.nan_to_num(log_odds), 0.0)
    weight = strength.clip(0).sum(0) + _FAINT
    ground, covariance = np.zeros((n, 2)), np.zeros((n, 2, 2))
    extent, height, mass = np.zeros(n), np.zeros(n), np.zeros(n)
    for b in range(n):
        inside = cells == b + 1
        share = weight[inside] / weight[inside].sum()
        blob_ground = cell_ground[inside]
        ground[b] = share @ blob_ground
        spread = blob_ground - ground[b]
        covariance[b] = (spread * share[:, None]).T @ spread / max(inside.sum(), 1) + np.eye(2) * grid.cell**2 / 12
        extent[b] = inside.sum() * grid.cell**2
        planes = occupied[:, inside].any(1)
        height[b] = grid.heights[np.flatnonzero(planes)[-1]]
        mass[b] = strength[:, inside].sum() / max(occupied[:, inside].sum(), 1)
    return Blobs(cells, track, person, ground, covariance, extent, height, mass, _touches(cells))


def _touches(cells: Labels) -> Ints:
    """Pairs of blobs, from 0, in one connected component of the ground, int64 (k, 2)."""
    component = connected(cells > 0, _EIGHT)[0]
    members = np.unique(np.stack([component[cells > 0], cells[cells > 0] - 1]), axis=1).T
    pairs = {(int(a), int(b)) for i, a in members for j, b in members if i == j and a < b}
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)
