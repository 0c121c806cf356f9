"""Candidates near each other: those that may replace each other, and those that stand too close for two bodies."""

import numpy as np

from stseg.arrays import Floats
from stseg.detection.problem import RaggedArray, ScoreParameters
from stseg.detection.score.scoring import contact_limit, pair_cost
from stseg.kernels.accelerate import kernel

REPLACEMENT_DISTANCE = 0.7
"""A member is replaced by candidates at most this far away, metres: more is another person."""


@kernel
def neighbours_of(ground: Floats, breadth: Floats, parameters: ScoreParameters) -> RaggedArray:
    """The others within the distance of replacements or of crowding of each candidate, with the cost of the pair, nats.

    `ground` (candidate, 2) and `breadth` (candidate,) are those of `DetectionProblem`.
    """
    candidates = len(ground)
    start, number = np.zeros(candidates + 1, np.int64), 0
    item, value = np.empty(candidates * candidates, np.int64), np.empty(candidates * candidates)
    reach = max(REPLACEMENT_DISTANCE, contact_limit(breadth, parameters))
    for i in range(candidates):
        for j in range(candidates):
            if max(abs(ground[i, 0] - ground[j, 0]), abs(ground[i, 1] - ground[j, 1])) > reach:
                continue
            cost = pair_cost(i, j, ground, breadth, parameters)
            distance = np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1])
            if i != j and (cost > 0 or distance <= REPLACEMENT_DISTANCE):
                item[number], value[number] = j, cost
                number += 1
        start[i + 1] = number
    return RaggedArray(start, item[:number].copy(), value[:number].copy())
