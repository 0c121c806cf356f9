"""Tracks that are short, or that most frames take for a ghost, go; short gaps are filled (METHODS 5, HW12 V-E)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import TrackingConfig
from stseg.model.tables import EVENT, TRAJECTORY


def drop_short(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> tuple[Rows, Rows]:
    """Tracks of fewer frames than the shortest person is there for.

    Returns
    -------
    TRAJECTORY, EVENT
        The rows of the others, and one event for each track that goes.
    """
    ids, where, counts = np.unique(trajectory["id"], return_inverse=True, return_counts=True)
    least = max(2, round(config.minimum_duration * frame_rate))
    short = counts < least
    reasons = [f"{count} frames, shorter than {least}" for count in counts[short]]
    return trajectory[~short[where]], _dropped(trajectory, ids[short], reasons)


def drop_ghosts(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> tuple[Rows, Rows]:
    """Tracks that more frames take for a ghost than for a person.

    Frames of gaps that would be filled count as such: who is followed and was not found there was weighed, and not
    believed. Of longer gaps nobody knows, so they do not count.

    Returns
    -------
    TRAJECTORY, EVENT
        The rows of the others, and one event for each track that goes.
    """
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    ids, where, counts = np.unique(trajectory["id"], return_inverse=True, return_counts=True)
    step, same = np.diff(trajectory["frame"][order]), np.diff(trajectory["id"][order]) == 0
    gap = np.where(same & (step <= config.interpolation_gap * frame_rate + 1), step - 1, 0)
    doubted = np.bincount(where[order][1:], gap, len(ids)).astype(int)
    ghost = doubted > counts
    reasons = [f"{no} of {no + yes} frames say ghost" for no, yes in zip(doubted[ghost], counts[ghost], strict=True)]
    return trajectory[~ghost[where]], _dropped(trajectory, ids[ghost], reasons)


def _dropped(trajectory: Rows, gone: Ints, reasons: Sequence[str]) -> Rows:
    """An event for each track that goes."""
    events = np.zeros(len(gone), EVENT)
    for event, identity, reason in zip(events, gone, reasons, strict=True):
        first = trajectory["frame"][trajectory["id"] == identity].min()
        event["frame"], event["kind"], event["id"], event["reason"] = first, b"dropped", identity, reason
    return events


def fill_gaps(trajectory: Rows, frame_rate: float, config: TrackingConfig) -> Rows:
    """Rows for frames in which a track was not seen for a moment, on a straight line between those in which it was.

    Their extent is 0 and their covariance grows with the distance to what was seen. Longer gaps stay, since nobody
    knows where the person was. Sorted by frame, then id.
    """
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    step, same = np.diff(table["frame"]), np.diff(table["id"]) == 0
    gaps = np.flatnonzero(same & (step > 1) & (step <= config.interpolation_gap * frame_rate + 1))
    rows = [trajectory, *(_between(table[k], table[k + 1]) for k in gaps.tolist())]
    every = np.concatenate(rows)
    return every[np.lexsort((every["id"], every["frame"]))]


_DRIFT = 0.1
"""Standard deviation that a place gains a frame away from the last that was seen, metres."""


def _between(before: np.void, after: np.void) -> Rows:
    frames = np.arange(before["frame"] + 1, after["frame"])
    filled = np.zeros(len(frames), TRAJECTORY)
    share = (frames - before["frame"]) / (after["frame"] - before["frame"])
    filled["frame"], filled["id"] = frames, before["id"]
    for name in ("x", "y", "raw_x", "raw_y", "xx", "xy", "yy", "height", "width", "score"):
        filled[name] = before[name] + share * (after[name] - before[name])
    away = np.minimum(frames - before["frame"], after["frame"] - frames)
    filled["xx"] += (_DRIFT * away) ** 2
    filled["yy"] += (_DRIFT * away) ** 2
    filled["views"] = before["views"]
    return filled
