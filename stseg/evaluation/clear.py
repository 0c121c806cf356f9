"""Matches over time, and the CLEAR measures.

Source: Bernardin and Stiefelhagen, "Evaluating multiple object tracking performance: the CLEAR MOT metrics", 2008;
mostly tracked, mostly lost and fragments: Li, Huang and Nevatia, CVPR 2009.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.arrays import Flags, Floats, Ints
from stseg.evaluation.sequence import Sequence, match, similarity


@dataclass(frozen=True, slots=True)
class Matches:
    """Matches of a sequence, by frame."""

    frame: Ints
    """int64 (k,): index in the sequence's list of frames, not the frame's number."""
    person: Ints
    track: Ints
    """int64 (k,) each."""
    distance: Floats
    """float64 (k,): metres."""
    predicted: Flags
    """bool (k,): whether the track's place is a prediction."""

    def __len__(self) -> int:
        return len(self.frame)


def match_per_frame(sequence: Sequence, gate: float) -> Matches:
    """Match each frame independently, as detections are evaluated (MODA, MODP)."""
    return _gather(sequence, [match(frame.distance, gate) for frame in sequence.frames])


def match_with_continuity(sequence: Sequence, gate: float) -> Matches:
    """CLEAR's matches: pairs of the previous frame continue while they are within the gate."""
    before, last = np.full(sequence.people, -1, np.int64), 0
    matches = []
    for frame in sequence.frames:
        if frame.index > last + 1:
            before.fill(-1)  # frames without people and tracks stand between
        last = frame.index
        rows, columns = match(frame.distance, gate, before[frame.person][:, None] == frame.track)
        before.fill(-1)
        before[frame.person[rows]] = frame.track[columns]
        matches.append((rows, columns))
    return _gather(sequence, matches)


def switches(pairs: Matches) -> int:
    """Number of identity switches: a person matched to another track than last time, however long ago."""
    order, same_person = _by_person(pairs)
    track = pairs.track[order]
    return int((same_person & (track[1:] != track[:-1])).sum())


def fragments(pairs: Matches) -> int:
    """Number of fragments: a person matched again after frames without a match."""
    order, same_person = _by_person(pairs)
    return int((same_person & (np.diff(pairs.frame[order]) > 1)).sum())


def matched_share(pairs: Matches, sequence: Sequence) -> Floats:
    """Share of each person's frames with a match, float64 (people,)."""
    return np.bincount(pairs.person, minlength=sequence.people) / sequence.person_frames


def false_tracks(pairs: Matches, sequence: Sequence) -> Flags:
    """Tracks matched in at most half of their frames, bool (tracks,)."""
    return np.asarray(np.bincount(pairs.track, minlength=sequence.tracks) <= sequence.track_frames / 2)


def _by_person(pairs: Matches) -> tuple[Ints, Flags]:
    """Order by person, then frame (k,), and whether neighbours in that order are one person (k - 1,)."""
    order = np.argsort(pairs.person, kind="stable")
    person = pairs.person[order]
    return order, person[1:] == person[:-1]


def _gather(sequence: Sequence, matches: list[tuple[Ints, Ints]]) -> Matches:
    index = np.array([frame.index for frame in sequence.frames], np.int64)
    frame = np.repeat(index, [len(rows) for rows, _ in matches])
    found = list(zip(sequence.frames, matches, strict=True))
    person = [frame.person[rows] for frame, (rows, _) in found]
    track = [frame.track[columns] for frame, (_, columns) in found]
    away = [frame.person_ground[rows] - frame.track_ground[columns] for frame, (rows, columns) in found]
    distance = [np.hypot(one[:, 0], one[:, 1]) for one in away]
    predicted = [frame.predicted[columns] for frame, (_, columns) in found]
    persons, tracks = np.concatenate([index[:0], *person]), np.concatenate([index[:0], *track])
    distances, are_predicted = np.concatenate([np.zeros(0), *distance]), np.concatenate([np.zeros(0, bool), *predicted])
    return Matches(frame, persons, tracks, distances, are_predicted)


def idf1(sequence: Sequence, gate: float) -> float:
    """2 IDTP / (truths + detections), 0..1; 0 where there are no people or no tracks.

    IDTP counts the frames in which a person is within the gate of its own track, where people and tracks are paired
    once for the whole sequence, so that there are most of them.
    """
    if not (sequence.people and sequence.tracks):
        return 0.0
    together = np.zeros((sequence.people, sequence.tracks), np.int64)
    for frame in sequence.frames:
        # not as distance <= gate, so that rounding at the gate itself agrees with TrackEval
        rows, columns = np.nonzero(similarity(frame.distance, 2 * gate) >= 0.5)
        together[frame.person[rows], frame.track[columns]] += 1
    true = int(together[linear_sum_assignment(together, maximize=True)].sum())
    return 2.0 * true / (sequence.truths + sequence.detections)
