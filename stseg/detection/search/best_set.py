"""Search of the best set of candidates (HW12 section IV-B; docs/how-it-works.md, Detection).

Candidates fall into groups that do not interact; the score is the sum over groups, so each is decided by itself, and
the work grows linearly with their number. Of a small group all subsets are tried: the best is found. A larger one is
improved by local search, which only ever raises the score. The bound: no set is better that differs by one person more,
one less or one exchanged for a nearby one, nor any that simple moves reach once one candidate was forced out or in.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.scoring import set_score
from stseg.detection.score.set_state import SetState, put, release, set_state
from stseg.detection.search.groups import fill_groups, restricted
from stseg.detection.search.local_search import SCORE_TOLERANCE, local_search, swap_moves
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed

ENUMERATION_LIMIT = 8
"""Most candidates of a group of which all subsets are tried in the final search."""


@kernel
def find_best_set(
    members: Ints, count: int, problem: DetectionProblem, enumeration_limit: int, swap_sweeps: int
) -> int:
    """Improve the set in place, starting from its first `count` members; returns its new size.

    `members` int64 (candidate + 1,) are indices of candidates. All subsets of groups of up to `enumeration_limit`
    candidates are tried; 0 for a set that is searched again. Larger groups have at most `swap_sweeps` sweeps of swap
    moves; 0 for simple moves alone.
    """
    return _improve(members, count, set_state(problem), enumeration_limit, swap_sweeps)


@kernel
def _improve(members: Ints, count: int, whole: SetState, enumeration_limit: int, swap_sweeps: int) -> int:
    """The search, group by group; the state's set is that of one group after the other."""
    state, candidates = pointed(whole), len(whole.inside)
    group_of = np.empty(candidates, np.int64)
    state.inside[members[:count]] = True
    for g in range(fill_groups(state, group_of)):
        group = np.flatnonzero(group_of == g)
        if len(group) <= enumeration_limit:
            state.size[0] = _best_of_all_subsets(state.members, group, restricted(whole.problem, group))
        else:
            start, state.size[0] = group[state.inside[group]], 0
            for i in start:
                put(i, state.size[0], state)
            local_search(group, group_of == g, state)
            if swap_sweeps > 0:
                swap_moves(group, swap_sweeps, state)
            release(state)
        state.inside[group] = False
        state.inside[state.members[: state.size[0]]] = True
    best = np.flatnonzero(state.inside)
    for a in range(len(best)):
        members[a] = best[a]
    return len(best)


@kernel
def _best_of_all_subsets(members: Ints, group: Ints, whole: DetectionProblem) -> int:
    """The best of all subsets; of equals, the one without the later candidates. Bits of a number name a subset."""
    problem = pointed(whole)
    best, best_score = 0, -np.inf
    for subset in range(1 << len(group)):
        subset_score = set_score(members, _fill_subset(subset, group, members), problem)
        if subset_score > best_score + SCORE_TOLERANCE:
            best, best_score = subset, subset_score
    return _fill_subset(best, group, members)


@kernel
def _fill_subset(subset: int, group: Ints, members: Ints) -> int:
    """Fill members with the subset that the bits name; returns its size."""
    count = 0
    for k in range(len(group)):
        if subset >> k & 1:
            members[count] = group[k]
            count += 1
    return count
