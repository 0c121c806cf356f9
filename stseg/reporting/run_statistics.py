"""Statistics of a run: certainty of its tracks, people by the minute and hour, ground by number of views."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Flags, Floats, Ints, Rows, by_track, ground_of

DOUBT_LIMIT = 0.9
"""Probability below which a point is doubtful."""
_LONG_RUN = 600.0
"""Length of a run from which its busiest minutes are shown separately, seconds."""
_BUSIEST = 3
"""Minutes that are shown so."""
_EXCHANGE_RATE, _RATE_NEAR_ENDS, _RATE_OF_ABSENCE = 0.058, 0.044, 0.15
"""Exchanges of a track, by each track that begins or ends near it, and by each second in which it has no row."""
_END_DISTANCE, _BORDER_WIDTH = 1.5, 0.5
"""Distance from such an end, and of such ends from the border, metres."""
_MINUTE, _HOUR = 60.0, 3600.0  # seconds


@dataclass(frozen=True)
class Span:
    """The frames that a chart shows, half open, and the recording's frames per second."""

    first: int
    stop: int
    frame_rate: float


class DoubtfulStretch(NamedTuple):
    """Consecutive points of a track that are doubtful."""

    track: int
    """Its id."""
    first: int
    last: int
    """Frames, both included."""
    certainty: float
    """Mean probability of its points, 0..1."""


def mean_certainty(trajectory: Rows, probability: Floats, tracks: Rows) -> Floats:
    """Mean probability (point,) of the points of each of `tracks`, float64 (n,), 0..1; nan for one without points."""
    ids, place = np.unique(trajectory["id"], return_inverse=True)
    sums, counts = np.bincount(place, probability, len(ids)), np.bincount(place, minlength=len(ids))
    means = dict(zip(ids.tolist(), (sums / np.maximum(counts, 1)).tolist(), strict=True))
    return np.array([means.get(int(track), np.nan) for track in tracks["id"]])


def exchange_chances(trajectory: Rows, tracks: Rows, frame_rate: float, border: Floats) -> Floats:
    """Chance that each of `tracks` shows another person for a second or more, float64 (n,), 0..1.

    It grows with each track that begins or ends near it, away from the border float64 (2, 2) (the lower and the upper
    corner of the ground, metres), and with the time without a row; the rates are of perturbed runs of recordings.
    """
    place = {track: k for k, track in enumerate(tracks["id"].tolist())}
    rows = trajectory[np.lexsort((trajectory["id"], trajectory["frame"]))]
    rate = _EXCHANGE_RATE + _RATE_OF_ABSENCE * (tracks["last"] - tracks["first"] + 1 - tracks["frames"]) / frame_rate
    for name in ("first", "last"):
        for track in tracks[(tracks[name] > rows["frame"][:1]) & (tracks[name] < rows["frame"][-1:])]:
            people = rows[slice(*np.searchsorted(rows["frame"], [track[name], track[name] + 1]))]
            ground, end = ground_of(people), people["id"] == track["id"]
            if end.any() and (np.minimum(ground[end] - border[0], border[1] - ground[end]) > _BORDER_WIDTH).all():
                neighbours = ~end & (np.hypot(*(ground - ground[end][0]).T) < _END_DISTANCE)
                rate[[place[track] for track in people["id"][neighbours].tolist() if track in place]] += _RATE_NEAR_ENDS
    return np.asarray(-np.expm1(-rate), float)


def doubtful_stretches(trajectory: Rows, probability: Floats) -> list[DoubtfulStretch]:
    """Stretches of doubtful points by the probability (point,) of each, by track and frame."""
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    rows, probability = trajectory[order], probability[order]
    doubtful = np.flatnonzero(probability < DOUBT_LIMIT)
    breaks = (np.diff(rows["id"][doubtful]) != 0) | (np.diff(rows["frame"][doubtful]) > 1)
    pieces = np.split(doubtful, np.flatnonzero(breaks) + 1) if len(doubtful) else []
    return [
        DoubtfulStretch(
            int(rows["id"][piece[0]]),
            int(rows["frame"][piece[0]]),
            int(rows["frame"][piece[-1]]),
            float(probability[piece].mean()),
        )
        for piece in pieces
    ]


def people_per_minute(frames: Ints, trajectory: Rows, frame_rate: float) -> Floats:
    """Mean number of people in each minute of the run that has frames, the last one perhaps shorter.

    Parameters
    ----------
    frames : int64 (time,)
        The run's frames.
    trajectory : TRAJECTORY (n,)
    frame_rate
        Frames per second.

    Returns
    -------
    float64 (minute,)
    """
    if not len(frames):
        return np.zeros(0)
    length = max(1, round(60 * frame_rate))
    minute, rows = (frames - frames[0]) // length, (trajectory["frame"] - frames[0]) // length
    frame_count = np.bincount(minute)
    people = np.bincount(rows, minlength=len(frame_count))[: len(frame_count)]
    return np.asarray(people[frame_count > 0] / frame_count[frame_count > 0], float)


def ground_by_views(views: Bytes, inside: Flags, cameras: int) -> Floats:
    """Share of the area of interest that 0, 1, 2, ... views see at some height, float64 (cameras + 1,).

    Parameters
    ----------
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    inside : bool (y, x)
        Cells of the area of interest.
    cameras
        Number of cameras.
    """
    view_count = views.max(axis=0)[inside]
    return np.asarray(np.bincount(view_count, minlength=cameras + 1) / max(len(view_count), 1), float)


@dataclass(frozen=True)
class BusyTime:
    """A part of a run."""

    first: int
    stop: int
    """Its frames, half open."""
    mean: float
    most: int
    """People at a time."""
    come: int
    """Tracks that begin in it."""


def people_by_hour(span: Span, trajectory: Rows) -> list[BusyTime]:
    """Each hour from the beginning of the run."""
    return _parts(span, trajectory, _HOUR)


def busiest_minutes(span: Span, trajectory: Rows) -> list[BusyTime]:
    """Minutes of a long run with most people, the earlier first where they are equal; in order of time."""
    if (span.stop - span.first) / span.frame_rate < _LONG_RUN:
        return []
    minutes = _parts(span, trajectory, _MINUTE)
    busiest = sorted(minutes, key=lambda one: (-one.mean, one.first))[:_BUSIEST]
    return sorted((one for one in busiest if one.mean > 0), key=lambda one: one.first)


def _parts(span: Span, trajectory: Rows, seconds: float) -> list[BusyTime]:
    length = max(1, round(seconds * span.frame_rate))
    edges: Ints = np.append(np.arange(span.first, span.stop, length), span.stop)
    counts = np.bincount(trajectory["frame"] - span.first, minlength=span.stop - span.first)
    begun, _ = np.histogram([float(rows["frame"][0]) for rows in by_track(trajectory)], edges)
    return [
        BusyTime(first, stop, float(counts_of_part.mean()), int(counts_of_part.max()), int(new))
        for first, stop, new in zip(edges[:-1].tolist(), edges[1:].tolist(), begun.tolist(), strict=True)
        if len(counts_of_part := counts[first - span.first : stop - span.first])
    ]
