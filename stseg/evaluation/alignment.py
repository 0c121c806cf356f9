"""Tracks on another ground than the truth's, such as that of `stseg calibrate auto`, turned and shifted onto it.

Each track is laid on each person whom it shares frames with. The placing under which most rows meet is fitted to these
rows again, until they stay the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from stseg.arrays import Complexes, Ints, Rows
from stseg.errors import FormatError
from stseg.evaluation.sequence import match

Alignment = Literal["none", "rigid", "similarity"]
_SHARED_FRAMES = 5
"""Least number of frames that a track and a person share."""
_PLACINGS = 200
"""Number of placings that are tried, those of the longest shared times."""
_ROUNDS = 20


@dataclass(frozen=True, slots=True)
class Placing:
    """The ground of the truth = factor * ground of the tracks + shift, x + iy in metres."""

    factor: complex
    shift: complex

    def of(self, rows: Rows) -> Rows:
        """Tracks on the ground of the truth."""
        moved = rows.copy()
        place = self.factor * _ground(rows) + self.shift
        moved["x"], moved["y"] = place.real, place.imag
        return moved


def best_placing(truth: Rows, trajectory: Rows, gate: float, alignment: Alignment) -> Placing:
    """The placing under which most rows of the tracks meet a person within the gate.

    Raises
    ------
    FormatError
        Where no track shares frames with a person.
    """
    if alignment == "none":
        return Placing(1 + 0j, 0j)
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
    placings = [_fitted(source[columns], target[rows], scales) for _, rows, columns in shared[:_PLACINGS]]
    best = max(placings, key=lambda placing: len(_pairs(truth, placing.of(trajectory), gate)[0]))
    for _ in range(_ROUNDS):
        rows, columns = _pairs(truth, best.of(trajectory), gate)
        if len(rows) < 2:
            break
        previous, best = best, _fitted(source[columns], target[rows], scales)
        if best == previous:
            break
    return best


def _fitted(source: Complexes, target: Complexes, scales: bool) -> Placing:
    """Least squares over turn, shift and perhaps scale (B. Horn, JOSA A 4(4), 1987)."""
    source_middle, target_middle = source.mean(), target.mean()
    factor = complex(np.vdot(source - source_middle, target - target_middle))
    size = float((np.abs(source - source_middle) ** 2).sum()) if scales else abs(factor)
    factor = factor / size if size else 1 + 0j
    return Placing(factor, complex(target_middle - factor * source_middle))


def _ground(rows: Rows) -> Complexes:
    return np.asarray(rows["x"] + 1j * rows["y"])


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
        first, second = match(np.abs(target[people][:, None] - source[tracks][None]), gate)
        rows.append(people[first])
        columns.append(tracks[second])
    return np.concatenate(rows), np.concatenate(columns)
