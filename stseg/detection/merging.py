"""Merge moves: members that stand near each other against one body, sized by the pixels of all of them.

A body that is wider or taller than its candidate leaves a strip of foreground over, and the strip finds a second body.
Adding, removing or replacing one person does not lead back: the two hold each other's pixels, and the size of either is
measured without them. So near members are also tried as one, measured with all that they explain together.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.detection.local_search import GAINED
from stseg.detection.map_estimate import MapEstimate
from stseg.detection.views import PixelView

_REACH = 0.6
"""Members at less than this distance may be one body, metres: half the widest body and half a common one."""


def merged(estimate: MapEstimate) -> MapEstimate:
    """The estimate with near members as one wherever that explains the frame better."""
    near = _near(estimate)
    if not near.any() or not any(isinstance(view, PixelView) for view in estimate.evidence.views):
        return estimate
    kept = _kept(estimate, near)
    absorbing = np.flatnonzero(near[kept].any(1))
    alone = estimate.with_members(estimate.members[kept]).refined().pool.at(absorbing)
    first = len(estimate.pool)
    best = estimate.with_pool(estimate.pool.joined_with(alone))
    for k, a in enumerate(kept[absorbing]):
        one = first + k
        others = np.flatnonzero(near[a])
        for absorbed in [others, *(others[[i]] for i in range(len(others) if len(others) > 1 else 0))]:
            gone = estimate.members[np.append(absorbed, a)]
            trial = best.with_members(np.append(best.members[~np.isin(best.members, gone)], one))
            if len(trial.members) < len(best.members) and trial.members_score.total > best.members_score.total + GAINED:
                best = trial
                break
    return best


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
