"""Isolated tracklets: parts of tracks between encounters and gaps, which belong to one person for certain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.config import MotionConfig, TrackingConfig
from stseg.tracking.assignment import distances

NEAR = 0.6
"""Distance of an encounter, metres."""
_END = 1.0
"""Length of the end of a tracklet from which its velocity is estimated, seconds."""
_FIRM = 0.02
"""Standard deviation of one person's height between two tracklets, however long, metres."""
_INDEPENDENT = 2.0
"""Frames to an independent observation of a height."""


@dataclass(frozen=True)
class TrackletEnd:
    """One end of a tracklet.

    Attributes
    ----------
    frame
        Of the recording.
    ground, velocity : float64 (2,)
        Metres, metres per second.
    velocity_variance
        Square metres per square second.
    """

    frame: int
    ground: Floats
    velocity: Floats
    velocity_variance: float


@dataclass(frozen=True)
class IsolatedTracklet:
    """Rows of one track, in the order of time.

    Attributes
    ----------
    track
        Its number.
    rows : int64 (n,)
        Indices into the trajectory.
    start, end
        Its two ends.
    height, height_variance
        Metres, square metres.
    """

    track: int
    rows: Ints
    start: TrackletEnd
    end: TrackletEnd
    height: float
    height_variance: float


def isolated_tracklets(
    trajectory: Rows, frame_rate: float, config: TrackingConfig, model: MotionConfig
) -> list[IsolatedTracklet]:
    """Tracks cut at gaps and at the closest approach of each encounter; sorted by first frame.

    Parameters
    ----------
    trajectory : TRAJECTORY (n,)
        Of the whole run, in any order.
    frame_rate
        Frames per second.
    """
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    track, frame = trajectory["id"][order], trajectory["frame"][order]
    met = np.isin(_keys(track, frame), _keys(*_meetings(trajectory, frame_rate)))
    begins = (np.diff(track, prepend=-1) != 0) | (np.diff(frame, prepend=-2) != 1) | met
    parts = np.split(order, np.flatnonzero(begins)[1:]) if len(order) else []
    found = [_measured(trajectory, rows, frame_rate, config, model) for rows in parts]
    return sorted(found, key=lambda tracklet: (tracklet.start.frame, tracklet.track))


def _keys(track: Ints, frame: Ints) -> Ints:
    return track * (1 << 40) + frame


def _meetings(trajectory: Rows, frame_rate: float) -> tuple[Ints, Ints]:
    """Tracks and frames of the closest approach of each encounter."""
    close: dict[tuple[int, int], list[tuple[int, float]]] = {}
    order = np.argsort(trajectory["frame"], kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(trajectory["frame"][order])) + 1):
        ground = np.column_stack([trajectory["x"][rows], trajectory["y"][rows]])
        away = distances(ground, ground)
        for a, b in np.argwhere(np.triu(away < NEAR, 1)):
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


def _measured(
    trajectory: Rows, rows: Ints, frame_rate: float, config: TrackingConfig, model: MotionConfig
) -> IsolatedTracklet:
    rows_of_end = max(2, round(_END * frame_rate))
    own = trajectory[rows]
    effective = max(len(rows) / _INDEPENDENT, 1.0)
    return IsolatedTracklet(
        int(own["id"][0]),
        rows,
        _tip(own[:rows_of_end], 0, frame_rate, model),
        _tip(own[-rows_of_end:], -1, frame_rate, model),
        float(own["height"].mean()),
        _FIRM**2 + config.height_noise**2 / effective,
    )


def _tip(own: Rows, at: int, frame_rate: float, model: MotionConfig) -> TrackletEnd:
    """An end of a tracklet: velocity by regression of its rows, with the population's pace as prior."""
    ground = np.column_stack([own["x"], own["y"]])
    seconds = (own["frame"] - own["frame"].mean()) / frame_rate
    precision = float((seconds**2).sum()) / model.position_noise**2
    variance = 1.0 / (precision + 1.0 / model.speed_spread**2)
    velocity = variance / model.position_noise**2 * (seconds @ ground)
    return TrackletEnd(int(own["frame"][at]), ground[at], np.asarray(velocity), variance)
