"""Isolated tracklets: parts of tracks between encounters and gaps, which belong to one person for certain."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.tracking.windows.near_rows import near_rows

_ENCOUNTER_DISTANCE = 0.6
"""Distance of an encounter, metres."""


def isolated_tracklets(trajectory: Rows, frame_rate: float) -> list[Ints]:
    """Tracks cut at gaps and at the closest approach of each encounter.

    Each is int64 (k,), rows of the trajectory, TRAJECTORY (n,) of the whole run in any order, in the order of time.
    `frame_rate` is in frames per second.
    """
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    track, frame = trajectory["id"][order], trajectory["frame"][order]
    met = np.isin(_keys(track, frame), _keys(*_meetings(trajectory, frame_rate)))
    begins = (np.diff(track, prepend=-1) != 0) | (np.diff(frame, prepend=-2) != 1) | met
    return np.split(order, np.flatnonzero(begins)[1:]) if len(order) else []


def _keys(track: Ints, frame: Ints) -> Ints:
    return track * (1 << 40) + frame


def _meetings(trajectory: Rows, frame_rate: float) -> tuple[Ints, Ints]:
    """Tracks and frames of the closest approach of each encounter."""
    pairs, away = near_rows(trajectory, _ENCOUNTER_DISTANCE)
    track, frame = trajectory["id"][pairs], trajectory["frame"][pairs[:, 0]]
    order = np.lexsort((frame, track[:, 1], track[:, 0]))
    track, frame, away = track[order], frame[order], away[order]
    encounter = np.cumsum(
        (np.diff(track, axis=0, prepend=-1) != 0).any(axis=1) | (np.diff(frame, prepend=0) > frame_rate)
    )
    nearest = np.lexsort((frame, away, encounter))
    nearest = nearest[np.diff(encounter[nearest], prepend=0) > 0]
    return track[nearest].reshape(-1), np.repeat(frame[nearest], 2)
