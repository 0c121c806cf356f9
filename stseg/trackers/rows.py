"""Rows of the trajectory table for one frame."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows, ground_of
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


def trajectory_rows(frame: int, tracks: TrackPlaces, extent: Floats) -> Rows:
    """TRAJECTORY rows of one frame, sorted by id, without views (`fill_views`).

    `extent` float64 (n,) is the ground area of each track, square metres.
    """
    ids, ground, covariance, height, width, score = tracks
    rows = np.zeros(len(ids), TRAJECTORY)
    rows["frame"], rows["id"] = frame, ids
    rows["x"], rows["y"] = ground[:, 0], ground[:, 1]
    rows["raw_x"], rows["raw_y"] = ground[:, 0], ground[:, 1]
    rows["xx"], rows["xy"], rows["yy"] = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    rows["height"], rows["width"] = height, width
    rows["extent"], rows["score"] = extent, score
    return rows[np.argsort(ids, kind="stable")]


def fill_views(rows: Rows, rig: Rig, used: Mapping[int, Flags]) -> None:
    """Fill the numbers of views that see the cell above each place, of the plane at which most of them see it.

    `used` bool (view,) says of each frame which views count in it: not those without evidence, frozen or excluded.
    """
    grid, cell = rig.grid, np.rint(rig.grid.cell_of(ground_of(rows))).astype(int)
    column, row = cell[:, 0].clip(0, grid.shape[2] - 1), cell[:, 1].clip(0, grid.shape[1] - 1)
    place = np.column_stack([grid.ground_x[column], grid.ground_y[row]])
    counted = np.array([used[frame] for frame in rows["frame"].tolist()], bool).reshape(len(rows), len(rig.cameras))
    sees = [camera.sees(place, grid.heights[:, None]) & counted[:, k] for k, camera in enumerate(rig.cameras)]
    rows["views"] = np.sum(sees, 0).max(0) * grid.contains(place)


def event_rows(events: list[Event]) -> Rows:
    """EVENT rows."""
    return np.array([(f, kind.encode(), i, other, reason.encode()) for f, kind, i, other, reason in events], EVENT)
