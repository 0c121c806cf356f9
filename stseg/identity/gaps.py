"""Short tracks go, short gaps are filled (HW12's temporal check; METHODS 5)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stseg.arrays import Rows
from stseg.config import IdentityConfig
from stseg.tracks import EVENT, TRAJECTORY


def drop_short(trajectory: Rows, frame_rate: float, config: IdentityConfig) -> tuple[Rows, Rows]:
    """Tracks of fewer frames than the shortest person is there for.

    Returns
    -------
    TRAJECTORY, EVENT
        The rows of the others, and one event for each track that goes.
    """
    ids, where, counts = np.unique(trajectory["id"], return_inverse=True, return_counts=True)
    least = max(2, round(config.shortest * frame_rate))
    gone = ids[counts < least]
    events = np.zeros(len(gone), EVENT)
    for event, identity in zip(events, gone, strict=True):
        own = trajectory[trajectory["id"] == identity]
        reason = f"{len(own)} frames, shorter than {least}"
        event["frame"], event["kind"], event["id"], event["reason"] = own["frame"][0], b"dropped", identity, reason
    return trajectory[counts[where] >= least], events


def fill_gaps(trajectory: Rows, frame_rate: float, config: IdentityConfig) -> Rows:
    """Rows for frames in which a track was not seen for a moment, on a straight line between those in which it was.

    Their extent is 0 and their covariance grows with the distance to what was seen. Longer gaps stay, since nobody
    knows where the person was. Sorted by frame, then id.
    """
    rows = [trajectory]
    for identity in np.unique(trajectory["id"]):
        own = trajectory[trajectory["id"] == identity]
        own = own[np.argsort(own["frame"], kind="stable")]
        for before, after in pairwise(own):
            if after["frame"] - before["frame"] <= config.bridge * frame_rate + 1:
                rows.append(_between(before, after))
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
