"""IDF1: share of the truth that one track a person covers.

Source: Ristani et al., "Performance measures and a data set for multi-target, multi-camera tracking", 2016.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from stseg.evaluation.matching import similarity
from stseg.evaluation.sequence import Sequence


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
