"""Rows of a whole run in groups, found at once: rows of each track, pairs of near people, and isolated tracklets.

Isolated tracklets are parts of tracks between encounters and gaps, which belong to one person for certain.
"""

import numpy as np

from stseg.arrays import Floats, Ints, Rows

EXCHANGE_DISTANCE = 0.8
"""Distance below which the filter may have exchanged two tracks, metres: they meet."""


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
    pairs, away = near_rows(trajectory, EXCHANGE_DISTANCE)
    track, frame = trajectory["id"][pairs], trajectory["frame"][pairs[:, 0]]
    order = np.lexsort((frame, track[:, 1], track[:, 0]))
    track, frame, away = track[order], frame[order], away[order]
    encounter = np.cumsum(
        (np.diff(track, axis=0, prepend=-1) != 0).any(axis=1) | (np.diff(frame, prepend=0) > frame_rate)
    )
    nearest = np.lexsort((frame, away, encounter))
    nearest = nearest[np.diff(encounter[nearest], prepend=0) > 0]
    return track[nearest].reshape(-1), np.repeat(frame[nearest], 2)


def near_rows(trajectory: Rows, distance: float) -> tuple[Ints, Floats]:
    """Pairs of rows of one frame less than a distance apart, metres; the trajectory, TRAJECTORY (n,), is in any order.

    Returns the rows of each pair, int64 (k, 2), that of the lower id first, and their distances, float64 (k,), in no
    order.
    """
    order = np.lexsort((trajectory["id"], trajectory["frame"]))
    frame, x, y = (trajectory[name][order] for name in ("frame", "x", "y"))
    pairs, distances = [np.zeros((0, 2), np.int64)], [np.zeros(0)]
    for step in range(1, len(order)):
        same = frame[step:] == frame[:-step]
        if not same.any():
            break
        away = np.hypot(x[step:] - x[:-step], y[step:] - y[:-step])
        pair = np.flatnonzero(same & (away < distance))
        pairs.append(np.column_stack([order[pair], order[pair + step]]))
        distances.append(away[pair])
    return np.concatenate(pairs), np.concatenate(distances)


def rows_of_tracks(ids: Ints) -> list[Ints]:
    """Rows of each track (`ids` int64 (n,) of all rows), by rising id; each in the order of the rows.

    A day has thousands of tracks, too many to search all rows for each.
    """
    order = np.argsort(ids, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(ids[order])) + 1) if len(order) else []
