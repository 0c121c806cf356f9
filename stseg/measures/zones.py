"""People in zones: counts over time with their uncertainty, and visits with entry, exit and dwell time."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Ints, Rows
from stseg.measures.areas import Zone

COUNT = np.dtype(
    [("frame", "<i8"), ("time", "<f8"), ("zone", "O"), ("people", "<i8"), ("expected", "<f8"), ("deviation", "<f8"),
     ("density", "<f8")]
)  # fmt: skip
"""One row per zone and frame: number of tracks; its mean and standard deviation by the tracks' scores; people a square
metre."""
VISIT = np.dtype(
    [("zone", "O"), ("id", "<i8"), ("first", "<i8"), ("last", "<i8"), ("start", "<f8"), ("dwell", "<f8"),
     ("entered", "?"), ("left", "?")]
)  # fmt: skip
"""One row per stay of a track in a zone: frames, seconds; whether the track was seen outside before and after."""
AWAY = 5.0
"""Gap of a track from which its person was away, seconds."""


def zone_counts(zone: Zone, trajectory: Rows, frames: Ints, frame_rate: float) -> Rows:
    """People in a zone in every frame of a run, COUNT (time,).

    A track exists with probability 1 / (1 + exp(-score)) of its row, independently of the others; the count's mean and
    variance are the sums of p and p (1 - p).
    """
    inside = trajectory[zone.contains(np.stack([trajectory["x"], trajectory["y"]], -1))]
    index = np.searchsorted(frames, inside["frame"])
    exists = 1 / (1 + np.exp(-np.clip(inside["score"].astype(float), -50, 50)))
    rows = np.zeros(len(frames), COUNT)
    rows["frame"], rows["time"], rows["zone"] = frames, frames / frame_rate, zone.name
    rows["people"] = np.bincount(index, minlength=len(frames))
    rows["expected"] = np.bincount(index, exists, len(frames))
    rows["deviation"] = np.sqrt(np.bincount(index, exists * (1 - exists), len(frames)))
    rows["density"] = rows["people"] / max(zone.area, 1e-9)
    return rows


def zone_visits(zone: Zone, trajectory: Rows, frame_rate: float, patience: float) -> Rows:
    """Stays of tracks in a zone, VISIT (n,), by start; absences of up to `patience` seconds do not end a stay."""
    visits = []
    for track in by_track(trajectory):
        inside = zone.contains(np.stack([track["x"], track["y"]], -1))
        starts, stops = _spells(inside, track["frame"], round(patience * frame_rate))
        for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
            first, last = int(track["frame"][start]), int(track["frame"][stop - 1])
            dwell = (last - first + 1) / frame_rate
            visits.append(
                (zone.name, int(track["id"][0]), first, last, first / frame_rate, dwell, start > 0, stop < len(track))
            )
    return np.sort(np.array(visits, VISIT), order=["first", "id"])


def by_track(trajectory: Rows) -> list[Rows]:
    """The rows of each track in order of time."""
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    return [track for track in np.split(table, np.flatnonzero(np.diff(table["id"])) + 1) if len(track)]


def stays(track: Rows, frame_rate: float) -> list[Rows]:
    """The rows of one track, parted where its person was away: the way from the exit to the entrance is unknown."""
    return np.split(track, np.flatnonzero(np.diff(track["frame"]) > AWAY * frame_rate) + 1)


def _spells(inside: Flags, frame: Ints, patience: int) -> tuple[Ints, Ints]:
    """Half-open index ranges of stays inside; short absences are bridged."""
    rows = np.flatnonzero(inside)
    if not len(rows):
        return rows, rows
    breaks = np.flatnonzero(np.diff(frame[rows]) > patience + 1) + 1
    starts = rows[np.concatenate([[0], breaks])]
    stops = rows[np.concatenate([breaks - 1, [len(rows) - 1]])] + 1
    return starts, stops
