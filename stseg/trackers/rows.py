"""Rows of the trajectory table for one frame."""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.geometry import Rig
from stseg.records.tables import EVENT, TRAJECTORY

Event = tuple[int, str, int, int, str]
"""frame, kind, id, other id, reason."""


class TrackPlaces(NamedTuple):
    """The n tracks of one frame."""

    ids: Ints
    """int64 (n,): track numbers."""
    ground: Floats
    """float64 (n, 2): metres."""
    covariance: Floats
    """float64 (n, 2, 2): square metres."""
    height: Floats
    """float64 (n,): metres, nan where unmeasured."""
    width: Floats
    """float64 (n,): metres, nan where unmeasured."""
    score: Floats
    """float64 (n,): nats."""


def trajectory_rows(frame: int, tracks: TrackPlaces, extent: Floats, views: Ints) -> Rows:
    """TRAJECTORY rows of one frame, sorted by id.

    `extent` float64 (n,) is the ground area of each track, square metres, `views` int64 (n,) the number of views that
    see the place.
    """
    ids, ground, covariance, height, width, score = tracks
    rows = np.zeros(len(ids), TRAJECTORY)
    rows["frame"], rows["id"] = frame, ids
    rows["x"], rows["y"] = ground[:, 0], ground[:, 1]
    rows["raw_x"], rows["raw_y"] = ground[:, 0], ground[:, 1]
    rows["xx"], rows["xy"], rows["yy"] = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    rows["height"], rows["width"] = height, width
    rows["extent"], rows["score"], rows["views"] = extent, score, views
    return rows[np.argsort(ids, kind="stable")]


def views_at(rig: Rig, ground: Floats) -> Ints:
    """Number of views that see some plane above each place (n, 2), int64 (n,)."""
    cell, most = np.rint(rig.grid.cell_of(ground)).astype(int), rig.most_views
    column, row = cell[:, 0].clip(0, most.shape[1] - 1), cell[:, 1].clip(0, most.shape[0] - 1)
    return np.asarray(most[row, column], np.int64)


def event_rows(events: list[Event]) -> Rows:
    """EVENT rows."""
    return np.array([(f, kind.encode(), i, other, reason.encode()) for f, kind, i, other, reason in events], EVENT)
