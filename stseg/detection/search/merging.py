"""Merge moves: members that stand near each other against one body, sized by the pixels of all of them.

A body that is wider or taller than its candidate leaves a strip of foreground over, and the strip finds a second body.
Adding, removing or replacing one person does not lead back: the two hold each other's pixels, and the size of either is
measured without them. So near members are also tried as one, measured with all that they explain together.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.bodies.views import PixelView
from stseg.detection.search.local_search import GAINED
from stseg.detection.search.map_estimate import MapEstimate
from stseg.records.candidates import Candidates

_REACH = 0.6
"""Members at less than this distance may be one body, metres: half the widest body and half a common one."""


def merged(estimate: MapEstimate) -> MapEstimate:
    """The estimate with near members as one wherever that explains the frame better."""
    near = _near(estimate)
    if not near.any() or not any(isinstance(view, PixelView) for view in estimate.evidence.views):
        return estimate
    kept = _kept(estimate, near)
    absorbing = np.flatnonzero(near[kept].any(1))
    alone = estimate.with_members(estimate.members[kept]).some_refined(absorbing).pool
    centred = _centred(estimate, near, kept).some_refined(absorbing).pool
    first = len(estimate.pool)
    best = estimate.with_more(alone.joined_with(centred))
    for k, a in enumerate(kept[absorbing]):
        ones = (first + k, first + len(absorbing) + k)
        others = np.flatnonzero(near[a])
        for absorbed in [others, *(others[[i]] for i in range(len(others) if len(others) > 1 else 0))]:
            gone = estimate.members[np.append(absorbed, a)]
            left = best.members[~np.isin(best.members, gone)]
            trial = max((best.with_members(np.append(left, one)) for one in ones), key=_total)
            if len(trial.members) < len(best.members) and _total(trial) > _total(best) + GAINED:
                best = trial
                break
    return best


def _total(estimate: MapEstimate) -> float:
    """Score of the members, nats."""
    return estimate.members_score.total


def _centred(estimate: MapEstimate, near: Flags, kept: Ints) -> MapEstimate:
    """The kept members alone, each at the mean place of all that it may absorb: three members stand on its rim.

    The mean is weighted by what the views say of each.
    """
    weight = np.where(near | np.eye(len(near), dtype=bool), estimate.members_score.view_evidence.sum(0).clip(1.0), 0.0)
    ground = (weight @ estimate.pool.ground[estimate.members] / weight.sum(1, keepdims=True))[kept]
    pool, first = estimate.pool, len(estimate.pool)
    members = estimate.members[kept]
    moved = Candidates(ground, pool.height[members], pool.width[members])
    return estimate.with_more(moved).with_members(np.arange(first, first + len(kept)))


def _near(estimate: MapEstimate) -> Flags:
    """Pairs of members that may be one body, bool (n, n)."""
    ground = estimate.pool.ground[estimate.members]
    apart = np.hypot(*(ground[:, None] - ground[None]).transpose(2, 0, 1))
    return np.asarray((apart < _REACH) & ~np.eye(len(ground), dtype=bool))


def _kept(estimate: MapEstimate, near: Flags) -> Ints:
    """Members none of which is near another, by falling evidence of the views: int64 (k,), indices of members."""
    kept: list[int] = []
    for a in np.argsort(-estimate.members_score.view_evidence.sum(0), kind="stable"):
        if not near[a][kept].any():
            kept.append(int(a))
    return np.array(kept, np.int64)
