"""The set of people that explains a frame best, by moves that only ever raise the score (METHODS 7).

Few candidates are enumerated: the best of all sets. Beyond that, one person at a time is added, removed or exchanged
until no move helps. The score is a sum over groups whose evidence does not touch, so moves in one group never depend on
another; the bound on sweeps is reached by none but crafted input.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Ints
from stseg.ghosts.evidence import Case
from stseg.ghosts.scoring import set_score

ENUMERATED = 8
"""Up to so many candidates all sets are tried."""
SWEEPS = 8
_GAINED = 1e-9
_NEAR = 0.7
_SLACK = 3.0


@kernel
def search(
    members: Ints,
    count: int,
    case: Case,
) -> int:
    """Improve the set in place, starting from its first `count` members; returns its new size.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        Indices of candidates; the first `count` are the set.
    """
    if len(case.own) <= ENUMERATED:
        return _enumerate(members, case)
    inside = np.zeros(len(case.own), np.bool_)
    for a in range(count):
        inside[members[a]] = True
    for _ in range(SWEEPS):
        score = set_score(members, count, case)
        grown = _add(members, count, score, inside, case)
        shrunk = _remove(members, grown, inside, case)
        exchanged = _exchange(members, shrunk, inside, case)
        if grown == count and shrunk == grown and not exchanged:
            break
        count = shrunk
    return count


@kernel
def _enumerate(members: Ints, case: Case) -> int:
    """The best of all sets; of several, the one that leaves out the later candidates. Bits of a number name a set."""
    candidates = len(case.own)
    best, best_score = 0, -np.inf
    for chosen in range(1 << candidates):
        score = set_score(members, _spell(chosen, candidates, members), case)
        if score > best_score + _GAINED:
            best, best_score = chosen, score
    return _spell(best, candidates, members)


@kernel
def _spell(chosen: int, candidates: int, members: Ints) -> int:
    """Fill members with the set that the bits name; returns its size."""
    count = 0
    for i in range(candidates):
        if chosen >> i & 1:
            members[count] = i
            count += 1
    return count


@kernel
def _add(
    members: Ints,
    count: int,
    score: float,
    inside: Flags,
    case: Case,
) -> int:
    """Add the best candidate while one helps; a candidate's gain seldom rises, so hopeless ones are tried once."""
    gain = np.full(len(case.own), np.inf)
    while count < len(case.own):
        best, best_gain = -1, _GAINED
        for i in range(len(case.own)):
            if inside[i] or gain[i] < best_gain - _SLACK:
                continue
            members[count] = i
            gain[i] = set_score(members, count + 1, case) - score
            if gain[i] > best_gain:
                best, best_gain = i, gain[i]
        if best < 0:
            break
        members[count], inside[best] = best, True
        count += 1
        score += best_gain
    return count


@kernel
def _remove(
    members: Ints,
    count: int,
    inside: Flags,
    case: Case,
) -> int:
    """Remove each member without whom the score is higher."""
    score = set_score(members, count, case)
    a = 0
    while a < count:
        leaving = members[a]
        members[a] = members[count - 1]
        without = set_score(members, count - 1, case)
        if without > score + _GAINED:
            inside[leaving] = False
            count -= 1
            score = without
        else:
            members[a] = leaving
            a += 1
    return count


@kernel
def _exchange(
    members: Ints,
    count: int,
    inside: Flags,
    case: Case,
) -> bool:
    """Replace each member by the near candidate that raises the score most."""
    changed = False
    score = set_score(members, count, case)
    for a in range(count):
        old, best = members[a], members[a]
        best_score = score + _GAINED
        for i in range(len(case.own)):
            apart = np.hypot(case.ground[i, 0] - case.ground[old, 0], case.ground[i, 1] - case.ground[old, 1])
            if inside[i] or apart > _NEAR:
                continue
            members[a] = i
            trial = set_score(members, count, case)
            if trial > best_score:
                best, best_score = i, trial
        members[a] = best
        if best != old:
            inside[old], inside[best] = False, True
            score, changed = best_score, True
    return changed
