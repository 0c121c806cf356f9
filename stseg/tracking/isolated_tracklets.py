"""Isolated tracklets: parts of tracks between encounters and gaps, which belong to one person for certain."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.tracking.assignment import distances

_ENCOUNTER_DISTANCE = 0.6
"""Distance of an encounter, metres."""


def isolated_tracklets(trajectory: Rows, frame_rate: float) -> list[Ints]:
    """Tracks cut at gaps and at the closest approach of each encounter.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
        Of the whole run, in any order.
    frame_rate
        Frames per second.

    Returns
    -------
    list of int64 (k,)
        Rows of each tracklet, in the order of time.
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
    close: dict[tuple[int, int], list[tuple[int, float]]] = {}
    order = np.argsort(trajectory["frame"], kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(trajectory["frame"][order])) + 1):
        ground = np.column_stack([trajectory["x"][rows], trajectory["y"][rows]])
        away = distances(ground, ground)
        for a, b in np.argwhere(np.triu(away < _ENCOUNTER_DISTANCE, 1)):
            one, other = sorted((int(trajectory["id"][rows[a]]), int(trajectory["id"][rows[b]])))
            close.setdefault((one, other), []).append((int(trajectory["frame"][rows[0]]), float(away[a, b])))
    track: list[int] = []
    frame: list[int] = []
    for pair, seen in close.items():
        when = np.array([f for f, _ in seen])
        for part in np.split(np.arange(len(seen)), np.flatnonzero(np.diff(when) > frame_rate) + 1):
            nearest = min(part, key=lambda k: seen[k][1])
            track += pair
            frame += [seen[nearest][0]] * 2
    return np.array(track, np.int64), np.array(frame, np.int64)
