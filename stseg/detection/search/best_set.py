"""Search of the best set of candidates (HW12 section IV-B; docs/how-it-works.md, Detection).

Candidates fall into groups that do not interact; the score is the sum over groups, so each is decided by itself, and
the work grows linearly with their number. Of a small group all subsets are tried: the best is found. A larger one is
improved by local search, which only ever raises the score. The bound: no set is better that differs by one person more,
one less or one exchanged for a nearby one, nor any that simple moves reach once one candidate was forced out or in. A
group that is too large for this ends with the best set that a number of gains led to.
"""

import numpy as np

from stseg.arrays import Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.moves import add, put, release, remove
from stseg.detection.score.set_state import SetState, set_state
from stseg.detection.search.groups import fill_groups
from stseg.detection.search.local_search import SCORE_TOLERANCE, local_search, swap_moves
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed

ENUMERATION_LIMIT = 8
"""Most candidates of a group of which all subsets are tried in the final search."""
GAIN_LIMIT = 100_000
"""Most gains that are computed in the search of one group, about."""


@kernel
def find_best_set(
    members: Ints, count: int, problem: DetectionProblem, enumeration_limit: int, swap_sweeps: int, gain_limit: int
) -> tuple[int, int]:
    """Improve the set in place, starting from its first `count` members.

    `members` int64 (candidate + 1,) are indices of candidates. All subsets of groups of up to `enumeration_limit`
    candidates are tried; 0 for a set that is searched again. Larger groups have at most `swap_sweeps` sweeps of swap
    moves, 0 for simple moves alone, and about `gain_limit` gains are computed. Returns the new size of the set, and the
    candidates of the largest group that was not searched to the end, 0 for none.
    """
    whole = set_state(problem)
    state, candidates, unfinished = pointed(whole), len(whole.inside), 0
    group_of = np.empty(candidates, np.int64)
    state.inside[members[:count]] = True
    for g in range(fill_groups(state, group_of)):  # the state's set is that of one group after the other
        group = np.flatnonzero(group_of == g)
        start, state.size[0], state.remaining[0] = group[state.inside[group]], 0, gain_limit
        for i in start:
            put(i, state.size[0], state)
        if len(group) <= enumeration_limit:
            _take_best_subset(group, state)
        else:
            local_search(group, group_of == g, state)
            if swap_sweeps > 0:
                swap_moves(group, swap_sweeps, state)
            if state.remaining[0] <= 0:
                unfinished = max(unfinished, len(group))
        release(state)
    best = np.flatnonzero(whole.inside)
    for a in range(len(best)):
        members[a] = best[a]
    return len(best), unfinished


@kernel
def _take_best_subset(group: Ints, state: SetState) -> None:
    """Make the set the best of all subsets; of equals, the one without the later candidates.

    Bits of a number name a subset, and each differs from the one before by one candidate (Gray code).
    """
    subset = 0
    for k in range(len(group)):
        subset += (1 << k) * state.inside[group[k]]
    best, best_score = subset, state.total[0]
    for number in range(1, 1 << len(group)):
        k = 0
        while not number >> k & 1:
            k += 1
        _exchange(group[k], state)
        subset ^= 1 << k
        rise = state.total[0] - best_score
        if rise > SCORE_TOLERANCE or (rise > -SCORE_TOLERANCE and subset < best):
            best, best_score = subset, state.total[0]
    for k in range(len(group)):
        if (best >> k & 1) != state.inside[group[k]]:
            _exchange(group[k], state)


@kernel
def _exchange(i: int, state: SetState) -> None:
    """Add candidate i to the set, or remove it where it is a member."""
    if not state.inside[i]:
        add(i, state.size[0], state)
        return
    a = 0
    while state.members[a] != i:
        a += 1
    remove(a, state)
