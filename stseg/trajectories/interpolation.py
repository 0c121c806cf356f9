"""Short gaps of tracks are filled by linear interpolation."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.config import TrackingConfig
from stseg.records.tables import TRAJECTORY
from stseg.tracking.filter.assignment import distances
from stseg.tracking.filter.track_filter import EXCLUSION_RADIUS

_DRIFT_PER_FRAME = 0.1
"""Growth of a place's standard deviation a frame away from the nearest detection, metres."""


def fill_gaps(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> Rows:
    """The trajectory with its interpolated rows, sorted by frame, then id."""
    rows = np.concatenate([trajectory, interpolated_rows(trajectory, frame_rate, config)])
    return rows[np.lexsort((rows["id"], rows["frame"]))]


def interpolated_rows(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> Rows:
    """TRAJECTORY rows in gaps of at most `tracking.interpolation_gap`.

    They have extent 0, and a covariance that grows with the time to the nearest detection. Longer gaps stay open: the
    path there is unknown.
    """
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    step, same = np.diff(table["frame"]), np.diff(table["id"]) == 0
    gaps = np.flatnonzero(same & (step > 1) & (step <= config.interpolation_gap * frame_rate + 1))
    return np.concatenate([np.zeros(0, TRAJECTORY), *(_between(table[k], table[k + 1]) for k in gaps.tolist())])


def apart_from(rows: Rows, trajectory: Rows) -> Rows:
    """Rows apart from all rows of the trajectory in the same frame: two bodies need two places."""
    free = np.ones(len(rows), bool)
    by_frame = trajectory[np.argsort(trajectory["frame"], kind="stable")]
    order = np.argsort(rows["frame"], kind="stable")
    for of_frame in np.split(order, np.flatnonzero(np.diff(rows["frame"][order])) + 1) if len(rows) else ():
        first, stop = np.searchsorted(by_frame["frame"], rows["frame"][of_frame[0]] + np.arange(2))
        away = distances(_ground(rows[of_frame]), _ground(by_frame[first:stop]))
        free[of_frame] = (away >= EXCLUSION_RADIUS).all(axis=1)
    return np.asarray(rows[free])


def _ground(rows: Rows) -> Floats:
    return np.column_stack([rows["x"], rows["y"]])


def _between(before: np.void, after: np.void) -> Rows:
    frames = np.arange(before["frame"] + 1, after["frame"])
    filled = np.zeros(len(frames), TRAJECTORY)
    fraction = (frames - before["frame"]) / (after["frame"] - before["frame"])
    filled["frame"], filled["id"] = frames, before["id"]
    for name in ("x", "y", "raw_x", "raw_y", "xx", "xy", "yy", "height", "width", "score"):
        filled[name] = before[name] + fraction * (after[name] - before[name])
    away = np.minimum(frames - before["frame"], after["frame"] - frames)
    filled["xx"] += (_DRIFT_PER_FRAME * away) ** 2
    filled["yy"] += (_DRIFT_PER_FRAME * away) ** 2
    filled["views"] = before["views"]
    return filled
