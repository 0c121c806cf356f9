"""Coincident tracks: two that stand in one place for a second are one person."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Ints, Rows
from stseg.records.tables import EVENT
from stseg.tracking.windows.near_rows import near_rows

_COINCIDENCE_DISTANCE = 0.12
"""Distance of two tracks in one place, metres: half a body's depth, for places of people in touch err."""


def coincident(trajectory: Rows, frame_rate: float, shortest: float) -> tuple[Flags, Rows]:
    """Rows that repeat another track.

    Of two tracks within half a body's depth of each other in every frame of `shortest` seconds or more, the rows of
    the one with the lower mean score are repetitions, for as long as that lasts.

    Returns
    -------
    bool (n,), EVENT (k,)
        Whether each TRAJECTORY row repeats another; a "dropped" event for each interval.
    """
    pairs = _near_pairs(trajectory)
    repeats, events = np.zeros(len(trajectory), bool), []
    for first, stop in _intervals(trajectory, pairs):
        one, other = pairs[first:stop].T
        length = int(trajectory["frame"][one[-1]] - trajectory["frame"][one[0]]) + 1
        if length < shortest * frame_rate or stop - first < length:
            continue
        lost, kept = (
            (one, other) if trajectory["score"][one].mean() < trajectory["score"][other].mean() else (other, one)
        )
        repeats[lost] = True
        reason = f"in one place with track {trajectory['id'][kept[0]]} for {length / frame_rate:.1f} s: one person"
        row = (trajectory["frame"][lost[0]], b"dropped", trajectory["id"][lost[0]], trajectory["id"][kept[0]])
        events.append((*row, reason.encode()))
    return repeats, np.array(events, EVENT)


def _near_pairs(trajectory: Rows) -> Ints:
    """Rows of two tracks in one place, int64 (k, 2), the lower id first; sorted by ids, then frame."""
    found, _ = near_rows(trajectory, _COINCIDENCE_DISTANCE)
    names = trajectory["id"][found]
    return found[np.lexsort((trajectory["frame"][found[:, 0]], names[:, 1], names[:, 0]))]


def _intervals(trajectory: Rows, pairs: Ints) -> list[tuple[int, int]]:
    """Half-open ranges of pairs that are of the same two tracks in consecutive frames."""
    if not len(pairs):
        return []
    names, frame = trajectory["id"][pairs], trajectory["frame"][pairs[:, 0]]
    breaks = np.flatnonzero((np.diff(names, axis=0) != 0).any(1) | (np.diff(frame) != 1)) + 1
    return list(zip([0, *breaks.tolist()], [*breaks.tolist(), len(pairs)], strict=True))
