"""Short tracks and tracks of ghosts are dropped (Huang and Wang 2012, section V.E)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import TrackingConfig
from stseg.records.tables import EVENT


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
    of_gone = np.flatnonzero(np.isin(trajectory["id"], gone))
    first = np.full(len(gone), np.iinfo(np.int64).max)
    np.minimum.at(first, np.searchsorted(gone, trajectory["id"][of_gone]), trajectory["frame"][of_gone])
    events = np.zeros(len(gone), EVENT)
    events["frame"], events["kind"], events["id"], events["reason"] = first, b"dropped", gone, reasons
    return events
