"""Merge moves: members that stand close together against one body, sized by the pixels of all of them.

A body that is wider or taller than its candidate leaves a strip of foreground over, and the strip finds a second body.
Adding, removing or replacing one person does not lead back: the two hold each other's pixels, and the size of either is
measured without them. So close members are also tried as one, measured with all that they explain together.
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.bodies.views import PixelView
from stseg.detection.search.local_search import SCORE_TOLERANCE
from stseg.detection.search.map_estimate import MapEstimate
from stseg.detection.search.open_ground import EVERYWHERE, OpenGround
from stseg.detection.search.refined_people import refined_members
from stseg.geometry.distances import distances
from stseg.records.candidates import Candidates

_MERGE_DISTANCE = 0.6
"""Members at less than this distance may be one body, metres: half the widest body and half a common one."""


def merged(estimate: MapEstimate, ground: OpenGround = EVERYWHERE) -> MapEstimate:
    """The estimate with close members as one wherever on the open ground that explains the frame better."""
    is_close = _close_pairs(estimate, ground)
    if not is_close.any() or not any(isinstance(view, PixelView) for view in estimate.evidence.views):
        return estimate
    separate = _separate_members(estimate, is_close)
    absorbing = np.flatnonzero(is_close[separate].any(1))
    in_place = refined_members(estimate.with_members(estimate.members[separate]), absorbing).pool
    centred = refined_members(_centred(estimate, is_close, separate), absorbing).pool
    best, merges = estimate.with_more(in_place.joined_with(centred)), _merges(estimate, is_close, separate[absorbing])
    while merges:
        leaving = np.zeros((len(merges), len(best.pool)), bool)
        for row, merge in zip(leaving, merges, strict=True):
            row[merge.members] = True
        bodies = np.array([merge.bodies for merge in merges])
        rises = best.rises(np.repeat(leaving, 2, 0), bodies.ravel()).reshape(-1, 2)
        is_better = (rises.max(1) > SCORE_TOLERANCE) & (leaving[:, best.members].sum(1) > 1)
        if not is_better.any():
            break
        k = int(is_better.argmax())
        body = bodies[k, rises[k].argmax()]
        best = best.with_members(np.append(best.members[~leaving[k, best.members]], body))
        merges = [merge for merge in merges[k + 1 :] if merge.bodies != merges[k].bodies]
    return best


class _Merge(NamedTuple):
    """Candidates (k,) that may be one body, and two candidates for that."""

    members: Ints
    bodies: tuple[int, int]


def _merges(estimate: MapEstimate, is_close: Flags, absorbing: Ints) -> list[_Merge]:
    """Each absorbing member with all that are close to it, then with each of them.

    The bodies come after the candidates of the estimate: one for each absorbing member, then another for each.
    """
    first, merges = len(estimate.pool), list[_Merge]()
    for k, a in enumerate(absorbing.tolist()):
        others = np.flatnonzero(is_close[a])
        for absorbed in [others, *(others[[i]] for i in range(len(others) if len(others) > 1 else 0))]:
            bodies = first + k, first + len(absorbing) + k
            merges.append(_Merge(estimate.members[np.append(absorbed, a)], bodies))
    return merges


def _centred(estimate: MapEstimate, is_close: Flags, separate: Ints) -> MapEstimate:
    """The separate members alone, each at the mean place of all that it may absorb: three members stand on its edge.

    The mean is weighted by the evidence of the views for each.
    """
    evidence = estimate.members_score.view_evidence.sum(0).clip(1.0)
    weight = np.where(is_close | np.eye(len(is_close), dtype=bool), evidence, 0.0)
    ground = (weight @ estimate.pool.ground[estimate.members] / weight.sum(1, keepdims=True))[separate]
    pool, first = estimate.pool, len(estimate.pool)
    members = estimate.members[separate]
    moved = Candidates(ground, pool.height[members], pool.width[members])
    return estimate.with_more(moved).with_members(np.arange(first, first + len(separate)))


def _close_pairs(estimate: MapEstimate, open_ground: OpenGround) -> Flags:
    """Pairs of members on open ground that may be one body, bool (n, n)."""
    ground = estimate.pool.ground[estimate.members]
    is_open = open_ground.covers(ground)
    is_close = (distances(ground, ground) < _MERGE_DISTANCE) & ~np.eye(len(ground), dtype=bool)
    return np.asarray(is_close & is_open & is_open[:, None])


def _separate_members(estimate: MapEstimate, is_close: Flags) -> Ints:
    """Members none of which is close to another, by falling evidence of the views: int64 (k,), indices of members."""
    separate: list[int] = []
    for a in np.argsort(-estimate.members_score.view_evidence.sum(0), kind="stable"):
        if not is_close[a][separate].any():
            separate.append(int(a))
    return np.array(separate, np.int64)
