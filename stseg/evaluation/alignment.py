"""Tracks on another ground than the truth's, such as that of `stseg calibrate auto`, turned and shifted onto it.

Each track is laid on each person whom it shares frames with. The motion under which most rows meet is fitted to these
rows again, until they stay the same.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.errors import FormatError
from stseg.evaluation.sequence import match
from stseg.geometry.distances import distances
from stseg.geometry.ground_motion import GroundMotion, fit_motion

Alignment = Literal["none", "rigid", "similarity"]
_SHARED_FRAMES = 5
"""Least number of frames that a track and a person share."""
_MOTIONS = 200
"""Number of motions that are tried, those of the longest shared times."""
_ROUNDS = 20


def moved_rows(rows: Rows, motion: GroundMotion) -> Rows:
    """Rows of tracks on another ground."""
    moved = rows.copy()
    moved["x"], moved["y"] = motion.of(_ground(rows)).T
    return moved


def best_motion(truth: Rows, trajectory: Rows, gate: float, alignment: Alignment) -> GroundMotion:
    """The motion of the tracks' ground under which most rows of the tracks meet a person within the gate.

    Raises
    ------
    FormatError
        Where no track shares frames with a person.
    """
    if alignment == "none":
        return GroundMotion(1 + 0j, 0j)
    scales = alignment == "similarity"
    shared = [
        (len(rows), rows, columns)
        for person in np.unique(truth["id"])
        for track in np.unique(trajectory["id"])
        for rows, columns in [_shared(truth, person, trajectory, track)]
        if len(rows) >= _SHARED_FRAMES
    ]
    if not shared:
        raise FormatError("tracks", "frame", "no track with frames of the truth", f"{_SHARED_FRAMES} shared frames")
    shared.sort(key=lambda one: -one[0])
    target, source = _ground(truth), _ground(trajectory)
    motions = [fit_motion(source[columns], target[rows], scales) for _, rows, columns in shared[:_MOTIONS]]
    best = max(motions, key=lambda motion: len(_pairs(truth, moved_rows(trajectory, motion), gate)[0]))
    for _ in range(_ROUNDS):
        rows, columns = _pairs(truth, moved_rows(trajectory, best), gate)
        if len(rows) < 2:
            break
        previous, best = best, fit_motion(source[columns], target[rows], scales)
        if best == previous:
            break
    return best


def _ground(rows: Rows) -> Floats:
    return np.stack([rows["x"], rows["y"]], -1)


def _shared(truth: Rows, person: int, trajectory: Rows, track: int) -> tuple[Ints, Ints]:
    """Rows of a person and of a track in the same frames."""
    rows, columns = np.flatnonzero(truth["id"] == person), np.flatnonzero(trajectory["id"] == track)
    _, first, second = np.intersect1d(truth["frame"][rows], trajectory["frame"][columns], return_indices=True)
    return rows[first], columns[second]


def _pairs(truth: Rows, trajectory: Rows, gate: float) -> tuple[Ints, Ints]:
    """Rows of people and of tracks that meet, frame by frame."""
    rows, columns = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    target, source = _ground(truth), _ground(trajectory)
    for frame in np.intersect1d(truth["frame"], trajectory["frame"]):
        people, tracks = np.flatnonzero(truth["frame"] == frame), np.flatnonzero(trajectory["frame"] == frame)
        first, second = match(distances(target[people], source[tracks]), gate)
        rows.append(people[first])
        columns.append(tracks[second])
    return np.concatenate(rows), np.concatenate(columns)
