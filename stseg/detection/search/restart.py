"""Restarts: the search again from the members who are sure, with the lattice of all that the others leave open.

A ghost that continues a track holds boxes of a person beside it. Without those boxes the lattice does not show that
person, and no exchange of one member for candidates near it leads back: the ghost lives on, from frame to frame, by its
track. So the doubtful members are put aside together, and the search decides anew who is there.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats
from stseg.detection.evidence.birth_lattice import lattice_candidates
from stseg.detection.search.map_estimate import MapEstimate

_DOUBTFUL = 12.0
"""Members whom the score would miss by less are put aside, nats."""
_WORTH = 1.0
"""Least rise of the score for which another set is taken, nats: less is a matter of where members stand."""
_MOST = 3
"""Restarts of one frame at most."""


def restarted(estimate: MapEstimate, lattice_ground: Floats) -> MapEstimate:
    """The estimate, or a better one that was found from its sure members alone.

    Parameters
    ----------
    estimate
        The result of a search.
    lattice_ground : float64 (y, x, 2)
        The lattice, metres.
    """
    for _ in range(_MOST):
        trial = better(estimate, _from_sure_members(estimate, lattice_ground))
        if trial is estimate:
            break
        estimate = trial
    return estimate


def better(estimate: MapEstimate, trial: MapEstimate) -> MapEstimate:
    """A trial, if it explains the frame better than the estimate."""
    return trial if trial.members_score.total > estimate.members_score.total + _WORTH else estimate


def is_doubtful(estimate: MapEstimate) -> bool:
    """Whether an estimate has members who would be put aside."""
    return bool((estimate.losses < _DOUBTFUL).any())


def _from_sure_members(estimate: MapEstimate, lattice_ground: Floats) -> MapEstimate:
    """A search that begins with the sure members; twice, the second time with places refined."""
    sure = estimate.members[estimate.losses >= _DOUBTFUL]
    if len(sure) == len(estimate.members):
        return estimate
    fresh = lattice_candidates(estimate.with_members(sure), lattice_ground).new_to(estimate.pool)
    found = estimate.searched_with(fresh, sure)
    exact, known = found.refined().pool, len(found.pool)
    return found.searched_with(exact, np.arange(known, known + len(exact)))
