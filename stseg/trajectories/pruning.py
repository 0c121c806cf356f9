"""Short tracks and tracks of ghosts are dropped (Huang and Wang 2012, section V.E), and repetitions of a track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Flags, Ints, Rows
from stseg.config import TrackingConfig
from stseg.records.tables import EVENT
from stseg.tracking.row_groups import near_rows


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
