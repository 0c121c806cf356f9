"""The set of people that explains a frame best (METHODS 7; HW12 section IV-B).

Candidates fall into groups whose evidence does not touch; the score is the sum over groups, so each is decided apart,
and the work grows with the number of groups as that does. Of a small group all sets are tried: the best is found. A
larger one is improved by moves that only ever raise its score, until none does. The bound: no set is better that
differs by one person more, one less or one exchanged for a near one, nor any that simple moves reach once somebody has
left or been let in. So the best set can be missed; how often is measured in docs/ghosts.md.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Ints
from stseg.detection.groups import alone, fill_groups, fill_touch
from stseg.detection.local_search import GAINED, local_search, swap
from stseg.detection.problem import Problem
from stseg.detection.scoring import set_score

ENUMERATED = 8
"""Of up to so many candidates all sets are tried, in a set that is not searched again."""


@kernel
def search(members: Ints, count: int, case: Problem, enumerated: int, trades: int) -> int:
    """Improve the set in place, starting from its first `count` members; returns its new size.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        Indices of candidates; the first `count` are the set.
    enumerated
        Of groups of up to so many candidates all sets are tried; none is so small where the set is searched again.
    trades
        How often all trades are tried at most in larger groups; 0 leaves it at simple moves.
    """
    candidates = len(case.own)
    touch, group = np.empty((candidates, candidates), np.bool_), np.empty(candidates, np.int64)
    fill_touch(case, touch)
    views, rows, columns = case.pixels.raster.shape
    owners, chosen = np.full((views, rows * columns), -1, np.int16), np.empty(candidates + 1, np.int64)
    inside = np.zeros(candidates, np.bool_)
    inside[members[:count]] = True
    for g in range(fill_groups(touch, group)):
        own = np.flatnonzero(group == g)
        part = alone(case, own)
        if len(own) <= enumerated:
            size = _enumerate(chosen, own, part)
        else:
            start = own[inside[own]]
            size = len(start)
            chosen[:size] = start
            size = local_search(chosen, size, own, inside, owners, part)
            size = swap(chosen, size, own, inside, touch, owners, trades, part)
        inside[own] = False
        inside[chosen[:size]] = True
    best = np.flatnonzero(inside)
    members[: len(best)] = best
    return len(best)


@kernel
def _enumerate(members: Ints, own: Ints, case: Problem) -> int:
    """The best of all sets; of several, the one that leaves out the later candidates. Bits of a number name a set."""
    best, best_score = 0, -np.inf
    for chosen in range(1 << len(own)):
        score = set_score(members, _spell(chosen, own, members), case)
        if score > best_score + GAINED:
            best, best_score = chosen, score
    return _spell(best, own, members)


@kernel
def _spell(chosen: int, own: Ints, members: Ints) -> int:
    """Fill members with the set that the bits name; returns its size."""
    count = 0
    for k in range(len(own)):
        if chosen >> k & 1:
            members[count] = own[k]
            count += 1
    return count
