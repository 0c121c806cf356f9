"""HOTA: detection and association in equal parts, averaged over nineteen similarity thresholds.

Source: Luiten et al., "HOTA: a higher order metric for evaluating multi-object tracking", IJCV 129, 2021.
"""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.evaluation.sequence import Sequence, best_pairs, similarity

ALPHAS = np.arange(0.05, 0.99, 0.05)
"""Similarity thresholds of a match."""
_ROUNDING = float(np.finfo(float).eps)


def hota(sequence: Sequence, radius: float) -> float:
    """Mean over alpha of sqrt(DetA AssA), 0..1; 0 where there are no people or no tracks.

    The similarity of a person and a track falls from 1 to 0 over `radius` metres.
    """
    if not (sequence.people and sequence.tracks):
        return 0.0
    pair, similar = _matches(sequence, radius)
    return float(np.mean([_hota_at(alpha, sequence, pair, similar) for alpha in ALPHAS]))


def _hota_at(alpha: float, sequence: Sequence, pair: Ints, similar: Floats) -> float:
    """sqrt(DetA AssA) at one alpha, from the matches' pair number and similarity."""
    pairs, together = np.unique(pair[similar >= alpha - _ROUNDING], return_counts=True)
    hits = together.sum()
    if not hits:
        return 0.0
    either = _frames_of(pairs, sequence) - together
    detection = hits / (sequence.truths + sequence.detections - hits)
    association = (together * (together / either)).sum() / hits
    return float(np.sqrt(detection * association))


def _matches(sequence: Sequence, radius: float) -> tuple[Ints, Floats]:
    """Pair number and similarity of every match; the assignment favours pairs that agree over the whole sequence."""
    numbers, shares = list[Ints](), list[Floats]()
    for frame in sequence.frames:
        similar = similarity(frame.distance, radius)
        rows, columns = place = np.nonzero(similar)
        numbers.append(frame.person[rows] * sequence.tracks + frame.track[columns])
        rivals = similar.sum(axis=0)[None] + similar.sum(axis=1)[:, None] - similar
        shares.append(np.divide(similar, rivals, out=np.zeros_like(similar), where=rivals > _ROUNDING)[place])
    aligned = np.split(_alignment(sequence, numbers, shares), np.cumsum([len(number) for number in numbers])[:-1])

    pairs, similarities = list[Ints](), list[Floats]()
    for frame, number, alignment in zip(sequence.frames, numbers, aligned, strict=True):
        similar = similarity(frame.distance, radius)
        place, score, pair = np.nonzero(similar), np.zeros(similar.shape), np.zeros(similar.shape, np.int64)
        score[place], pair[place] = alignment * similar[place], number
        chosen = best_pairs(score)
        pairs.append(pair[chosen])
        similarities.append(similar[chosen])
    return np.concatenate(pairs), np.concatenate(similarities)


def _alignment(sequence: Sequence, numbers: list[Ints], shares: list[Floats]) -> Floats:
    """Global alignment score of person and track (a Jaccard index, 0..1), for every entry of `numbers`."""
    pairs, index = np.unique(np.concatenate(numbers), return_inverse=True)
    agreed = np.bincount(index, np.concatenate(shares), minlength=len(pairs))
    return np.asarray((agreed / (_frames_of(pairs, sequence) - agreed))[index])


def _frames_of(pairs: Ints, sequence: Sequence) -> Ints:
    """Frames of the person plus frames of the track, for pair numbers person * tracks + track."""
    person, track = np.divmod(pairs, sequence.tracks)
    return np.asarray(sequence.person_frames[person] + sequence.track_frames[track])
