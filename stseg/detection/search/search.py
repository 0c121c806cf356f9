"""Search of the best set of candidates (HW12 section IV-B; docs/how-it-works.md, Detection).

Candidates fall into groups that do not interact; the score is the sum over groups, so each is decided apart, and the
work grows linearly with their number. Of a small group all subsets are tried: the best is found. A larger one is
improved by local search, which only ever raises the score. The bound: no set is better that differs by one person more,
one less or one exchanged for a near one, nor any that simple moves reach once one candidate was forced out or in.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints
from stseg.detection.problem import Problem
from stseg.detection.score.scoring import set_score
from stseg.detection.score.sharing import Sharing, sharing_of
from stseg.detection.search.groups import fill_groups, fill_interactions, restricted
from stseg.detection.search.local_search import GAINED, local_search, swap
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed

ENUMERATED = 8
"""Largest group of which all subsets are tried in the final search."""


@kernel
def search(members: Ints, count: int, problem: Problem, enumerated: int, trades: int) -> int:
    """Improve the set in place, starting from its first `count` members; returns its new size.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        Indices of candidates; the first `count` are the set.
    enumerated
        All subsets of groups of up to so many candidates are tried; 0 for a set that is searched again.
    trades
        Sweeps of swap moves in larger groups, at most; 0 for simple moves alone.
    """
    return _improve(members, count, problem, sharing_of(problem), enumerated, trades)


@kernel
def _improve(members: Ints, count: int, whole: Problem, shared: Sharing, enumerated: int, trades: int) -> int:
    """The search, with what candidates share at hand."""
    problem, sharing = pointed(whole), pointed(shared)
    candidates = len(problem.size_prior)
    beside = candidates if trades > 0 else 0  # swap moves alone ask who interacts with whom
    interacts, group = np.empty((beside, beside), np.bool_), np.empty(candidates, np.int64)
    if trades > 0:
        fill_interactions(problem, sharing, interacts)
    chosen, inside = np.empty(candidates + 1, np.int64), np.zeros(candidates, np.bool_)
    inside[members[:count]] = True
    for g in range(fill_groups(problem, sharing, group)):
        own = np.flatnonzero(group == g)
        if len(own) <= enumerated:
            size = _best_of_all_subsets(chosen, own, restricted(whole, own))
        else:
            start = own[inside[own]]
            size = len(start)
            for a in range(size):
                chosen[a] = start[a]
            size = local_search(chosen, size, own, inside, problem.owner, problem, sharing)
            if trades > 0:
                size = swap(chosen, size, own, inside, interacts, problem.owner, trades, problem, sharing)
        inside[own] = False
        inside[chosen[:size]] = True
    best = np.flatnonzero(inside)
    for a in range(len(best)):
        members[a] = best[a]
    return len(best)


@kernel
def _best_of_all_subsets(members: Ints, own: Ints, whole: Problem) -> int:
    """The best of all subsets; of equals, the one without the later candidates. Bits of a number name a subset."""
    problem = pointed(whole)
    best, best_score = 0, -np.inf
    for chosen in range(1 << len(own)):
        score = set_score(members, _members_of(chosen, own, members), problem)
        if score > best_score + GAINED:
            best, best_score = chosen, score
    return _members_of(best, own, members)


@kernel
def _members_of(chosen: int, own: Ints, members: Ints) -> int:
    """Fill members with the subset that the bits name; returns its size."""
    count = 0
    for k in range(len(own)):
        if chosen >> k & 1:
            members[count] = own[k]
            count += 1
    return count
