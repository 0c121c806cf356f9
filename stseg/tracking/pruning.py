"""Short tracks and tracks of ghosts are dropped, short gaps filled (Hwang and Wang 2012, section V.E)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import TrackingConfig
from stseg.model.tables import EVENT, TRAJECTORY


def drop_short(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> tuple[Rows, Rows]:
    """Drop tracks shorter than `tracking.minimum_duration`.

    Returns
    -------
    TRAJECTORY, EVENT
        Rows of the tracks that stay; one event for each dropped track.
    """
    ids, where, counts = np.unique(trajectory["id"], return_inverse=True, return_counts=True)
    least = max(2, round(config.minimum_duration * frame_rate))
    short = counts < least
    reasons = [f"{count} frames, shorter than {least}" for count in counts[short]]
    return trajectory[~short[where]], _dropped(trajectory, ids[short], reasons)


def drop_ghosts(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> tuple[Rows, Rows]:
    """Drop tracks that are rejected as ghosts in more frames than they are detected in.

    Frames of short gaps count as rejections: the predicted track was a candidate there and was rejected. Longer gaps
    are unobserved and do not count.

    Returns
    -------
    TRAJECTORY, EVENT
        Rows of the tracks that stay; one event for each dropped track.
    """
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    ids, where, counts = np.unique(trajectory["id"], return_inverse=True, return_counts=True)
    step, same = np.diff(trajectory["frame"][order]), np.diff(trajectory["id"][order]) == 0
    gap = np.where(same & (step <= config.interpolation_gap * frame_rate + 1), step - 1, 0)
    rejected = np.bincount(where[order][1:], gap, len(ids)).astype(int)
    ghost = rejected > counts
    reasons = [f"{no} of {no + yes} frames say ghost" for no, yes in zip(rejected[ghost], counts[ghost], strict=True)]
    return trajectory[~ghost[where]], _dropped(trajectory, ids[ghost], reasons)


def _dropped(trajectory: Rows, gone: Ints, reasons: Sequence[str]) -> Rows:
    """An event for each dropped track."""
    events = np.zeros(len(gone), EVENT)
    for event, identity, reason in zip(events, gone, reasons, strict=True):
        first = trajectory["frame"][trajectory["id"] == identity].min()
        event["frame"], event["kind"], event["id"], event["reason"] = first, b"dropped", identity, reason
    return events


def fill_gaps(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> Rows:
    """Fill gaps of at most `tracking.interpolation_gap` by linear interpolation.

    Filled rows have extent 0, and a covariance that grows with the time to the nearest detection. Longer gaps stay
    open: the path there is unknown. Sorted by frame, then id.
    """
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    step, same = np.diff(table["frame"]), np.diff(table["id"]) == 0
    gaps = np.flatnonzero(same & (step > 1) & (step <= config.interpolation_gap * frame_rate + 1))
    rows = [trajectory, *(_between(table[k], table[k + 1]) for k in gaps.tolist())]
    every = np.concatenate(rows)
    return every[np.lexsort((every["id"], every["frame"]))]


_DRIFT = 0.1
"""Growth of a place's standard deviation a frame away from the nearest detection, metres."""


def _between(before: np.void, after: np.void) -> Rows:
    frames = np.arange(before["frame"] + 1, after["frame"])
    filled = np.zeros(len(frames), TRAJECTORY)
    fraction = (frames - before["frame"]) / (after["frame"] - before["frame"])
    filled["frame"], filled["id"] = frames, before["id"]
    for name in ("x", "y", "raw_x", "raw_y", "xx", "xy", "yy", "height", "width", "score"):
        filled[name] = before[name] + fraction * (after[name] - before[name])
    away = np.minimum(frames - before["frame"], after["frame"] - frames)
    filled["xx"] += (_DRIFT * away) ** 2
    filled["yy"] += (_DRIFT * away) ** 2
    filled["views"] = before["views"]
    return filled
