"""Tracks on another ground than the truth's, such as that of `stseg calibrate auto`, turned and shifted onto it.

Each track is laid on each person whom it shares frames with. The motion under which most rows meet is fitted to these
rows again, until they stay the same.
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from stseg.arrays import Floats, Ints, Rows, ground_of
from stseg.errors import FormatError
from stseg.evaluation.sequence import match, require_rows
from stseg.geometry.distances import distances
from stseg.geometry.ground_motion import GroundMotion, fit_motion

Alignment = Literal["none", "rigid", "similarity"]
_SHARED_FRAMES = 5
"""Least number of frames that a track and a person share."""
_MOTIONS = 200
"""Number of motions that are tried, those of the longest shared times."""
_ROUNDS = 20
_FREQUENT = 40
"""Number of people and of tracks that are laid on each other, those with most rows."""
_SAMPLED_ROWS = 3_000
"""Rows by which motions are compared."""


def moved_rows(rows: Rows, motion: GroundMotion) -> Rows:
    """Rows of tracks on another ground."""
    moved = rows.copy()
    moved["x"], moved["y"] = motion.of(ground_of(rows)).T
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
    require_rows(truth, "truth")
    require_rows(trajectory, "tracks")
    scales = alignment == "similarity"
    shared = [
        (len(rows), rows, columns)
        for person in _frequent(truth)
        for track in _frequent(trajectory)
        for rows, columns in [_shared(truth, person, trajectory, track)]
        if len(rows) >= _SHARED_FRAMES
    ]
    if not shared:
        raise FormatError("tracks", "frame", "no track with frames of the truth", f"{_SHARED_FRAMES} shared frames")
    shared.sort(key=lambda one: -one[0])
    target, source = ground_of(truth), ground_of(trajectory)
    motions = [fit_motion(source[columns], target[rows], scales) for _, rows, columns in shared[:_MOTIONS]]
    tree, few = cKDTree(places_by_frame(truth, gate)), sampled(trajectory)
    best = max(motions, key=lambda motion: number_met(tree, moved_rows(few, motion), gate))
    for _ in range(_ROUNDS):
        rows, columns = _pairs(truth, moved_rows(trajectory, best), gate)
        if len(rows) < 2:
            break
        previous, best = best, fit_motion(source[columns], target[rows], scales)
        if best == previous:
            break
    return best


def sampled(rows: Rows) -> Rows:
    """The rows of some frames, evenly spread, so that they are some thousands."""
    frames = np.unique(rows["frame"])
    return rows[np.isin(rows["frame"], frames[:: -(-len(rows) // _SAMPLED_ROWS) or 1])]


def places_by_frame(rows: Rows, gate: float) -> Floats:
    """Frame and place, float64 (n, 3), such that rows within a gate of each other are of one frame."""
    return np.column_stack([2 * gate * rows["frame"], ground_of(rows)])


def number_met(tree: cKDTree, rows: Rows, gate: float) -> int:
    """Number of the tree's rows (`places_by_frame`) that are within a gate of rows, and the nearest of one."""
    distance, nearest = tree.query(places_by_frame(rows, gate), distance_upper_bound=gate)
    return len(np.unique(np.asarray(nearest)[np.isfinite(distance)]))


def _frequent(rows: Rows) -> Ints:
    """The ids with most rows."""
    ids, counts = np.unique(rows["id"], return_counts=True)
    return np.asarray(ids[np.argsort(-counts, kind="stable")[:_FREQUENT]])


def _shared(truth: Rows, person: int, trajectory: Rows, track: int) -> tuple[Ints, Ints]:
    """Rows of a person and of a track in the same frames."""
    rows, columns = np.flatnonzero(truth["id"] == person), np.flatnonzero(trajectory["id"] == track)
    _, first, second = np.intersect1d(truth["frame"][rows], trajectory["frame"][columns], return_indices=True)
    return rows[first], columns[second]


def _pairs(truth: Rows, trajectory: Rows, gate: float) -> tuple[Ints, Ints]:
    """Rows of people and of tracks that meet, frame by frame."""
    rows, columns = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    target, source = ground_of(truth), ground_of(trajectory)
    frames = np.intersect1d(truth["frame"], trajectory["frame"])
    for people, tracks in zip(_by_frame(truth, frames), _by_frame(trajectory, frames), strict=True):
        first, second = match(distances(target[people], source[tracks]), gate)
        rows.append(people[first])
        columns.append(tracks[second])
    return np.concatenate(rows), np.concatenate(columns)


def _by_frame(rows: Rows, frames: Ints) -> Iterator[Ints]:
    """Indices of the rows of each of the frames."""
    order: Ints = np.argsort(rows["frame"], kind="stable")
    starts, stops = (np.searchsorted(rows["frame"][order], one).tolist() for one in (frames, frames + 1))
    return (order[start:stop] for start, stop in zip(starts, stops, strict=True))
