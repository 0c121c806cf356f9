"""Restarts: the search again without weak members, with the lattice of all that the others leave unexplained.

A ghost that continues a track may hold boxes of a person next to it. Without those boxes the lattice does not show that
person, and no exchange of one member for nearby candidates leads back: the ghost lives on, from frame to frame, by its
track. So the weak members are removed together, and the frame is searched from the others.
"""

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.refined_people import refined_members

_REMOVAL_MARGIN = 12.0
"""Members are removed before a restart if that lowers the score by less, nats."""
_MINIMUM_GAIN = 1.0
"""Least rise of the score for which another set is taken, nats: less is a matter of the members' exact places."""


def restarted(estimate: MapEstimate, lattice_ground: Floats, restarts: int) -> MapEstimate:
    """The estimate of a search, or a better one that was found from its strong members alone.

    `lattice_ground` float64 (y, x, 2) is the birth lattice, metres; `restarts` are made at most.
    """
    for _ in range(restarts):
        trial = better_of(estimate, _from_strong_members(estimate, lattice_ground))
        if trial is estimate:
            break
        estimate = trial
    return estimate


def better_of(estimate: MapEstimate, trial: MapEstimate) -> MapEstimate:
    """A trial, if it explains the frame better than the estimate."""
    return trial if trial.total > estimate.total + _MINIMUM_GAIN else estimate


def weak_members(estimate: MapEstimate) -> Ints:
    """Members that a restart would remove, int64 (k,), counted from 0."""
    return np.flatnonzero(estimate.losses < _REMOVAL_MARGIN)


def _from_strong_members(estimate: MapEstimate, lattice_ground: Floats) -> MapEstimate:
    """A search that begins with the strong members; twice, the second time with places refined."""
    strong = np.delete(estimate.members, weak_members(estimate))
    if len(strong) == len(estimate.members):
        return estimate
    more = lattice_candidates(estimate.with_members(strong), lattice_ground).new_to(estimate.pool)
    result = estimate.searched_with(more, strong)
    if np.array_equal(result.members, estimate.members):
        return estimate  # the same people: to refine their places once more is worth less than `_MINIMUM_GAIN`
    refined, number = refined_members(result).pool, len(result.pool)
    return result.searched_with(refined, np.arange(number, number + len(refined)))
