"""Moves from one set of people to a better one, among the candidates of one group (METHODS 7).

Simple moves add, remove or replace one person. A trade takes more at once: somebody leaves, or somebody is let in, and
simple moves answer before the whole is judged; so one ghost gives way to the two people whose evidence it had taken,
and two to the one who explains both.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Ints
from stseg.detection.gains import come_in, fill_owners, gain_of, leave, paired, unpaired_gain, wipe_owners
from stseg.detection.problem import Owners, Problem
from stseg.detection.scoring import set_score

SWEEPS = 8
GAINED = 1e-9
_NEAR = 0.7
_SLACK = 3.0
_HOPELESS = -12.0
"""A person who adds less than this is not let in on trial, nats: whoever leaves for them cannot make up for it."""


@kernel
def local_search(members: Ints, count: int, own: Ints, inside: Flags, owners: Owners, case: Problem) -> int:
    """Simple moves until none helps; returns the set's new size.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        The first `count` are the set.
    own : int64 (n,)
        The candidates who may come in.
    inside : bool (candidate,)
        Who of all is in the set.
    owners : int16 (view, v * u)
        Scratch, -1 everywhere before and after.
    """
    for _ in range(SWEEPS):
        grown = _add(members, count, own, inside, owners, case)
        shrunk = _remove(members, grown, -1, inside, inside, owners, case)
        exchanged = _exchange(members, shrunk, own, inside, owners, case)
        if grown == count and shrunk == grown and not exchanged:
            break
        count = shrunk
    return count


@kernel
def swap(
    members: Ints, count: int, own: Ints, inside: Flags, touch: Flags, owners: Owners, trades: int, case: Problem
) -> int:
    """All trades, at most so many times, until none helps; takes what `local_search` takes, and who touches whom."""
    trial, trial_inside = members.copy(), inside.copy()
    score = set_score(members, count, case)
    for _ in range(trades):
        before = score
        for i in own:
            trial[:], trial_inside[:] = members, inside
            near = own[touch[i][own]]
            if inside[i]:
                size = _leave(trial, count, i, near[near != i], trial_inside, owners, case)
            else:
                size = _let_in(trial, count, i, trial_inside, touch, owners, case)
            if size < 0:
                continue
            size = local_search(trial, size, near, trial_inside, owners, case)
            after = set_score(trial, size, case)
            if after > score + GAINED:
                members[:], inside[:], count, score = trial, trial_inside, size, after
        if score <= before + GAINED:
            break
    return count


@kernel
def _leave(members: Ints, count: int, i: int, near: Ints, inside: Flags, owners: Owners, case: Problem) -> int:
    """Somebody leaves, and those near come in who had been in their shade; the set's size, or -1 where nobody does."""
    for a in range(count):
        if members[a] == i:
            members[a] = members[count - 1]
    inside[i] = False
    size = _add(members, count - 1, near, inside, owners, case)
    return size if size > count - 1 else -1


@kernel
def _let_in(members: Ints, count: int, i: int, inside: Flags, touch: Flags, owners: Owners, case: Problem) -> int:
    """Somebody is let in, and those leave who are worth nothing beside them; the set's size, or -1 where nobody does.

    Where one leaves to whom they stand near, that is an exchange, and was tried.
    """
    fill_owners(members, count, case.pixels, owners)
    gain = gain_of(i, members, count, paired(members, count, case), owners, case)
    wipe_owners(members, count, case.pixels, owners)
    if gain < _HOPELESS:
        return -1
    before = members[:count].copy()
    members[count], inside[i] = i, True
    left = _remove(members, count + 1, i, touch[i], inside, owners, case)
    gone = before[~inside[before]]
    if len(gone) == 0 or (len(gone) == 1 and _apart(i, gone[0], case) <= _NEAR):
        return -1
    return left


@kernel
def _apart(i: int, j: int, case: Problem) -> float:
    return float(np.hypot(case.ground[i, 0] - case.ground[j, 0], case.ground[i, 1] - case.ground[j, 1]))


@kernel
def _add(members: Ints, count: int, own: Ints, inside: Flags, owners: Owners, case: Problem) -> int:
    """Add the best candidate while one helps; a candidate's gain seldom rises, so hopeless ones are tried once."""
    gain = np.full(len(own), np.inf)
    fill_owners(members, count, case.pixels, owners)
    while True:
        best, best_gain = -1, GAINED
        pairs = paired(members, count, case)
        for k in range(len(own)):
            if inside[own[k]] or gain[k] < best_gain - _SLACK:
                continue
            gain[k] = gain_of(own[k], members, count, pairs, owners, case)
            if gain[k] > best_gain:
                best, best_gain = own[k], gain[k]
        if best < 0:
            break
        members[count], inside[best] = best, True
        count += 1
        come_in(best, case.pixels, owners)
    wipe_owners(members, count, case.pixels, owners)
    return count


@kernel
def _remove(members: Ints, count: int, keep: int, may: Flags, inside: Flags, owners: Owners, case: Problem) -> int:
    """Remove each member without whom the score is higher, of those who may (candidate,) leave, but not `keep`."""
    fill_owners(members, count, case.pixels, owners)
    pairs = paired(members, count, case)
    a = 0
    while a < count:
        leaving = members[a]
        if not may[leaving] or leaving == keep:
            a += 1
            continue
        members[a] = members[count - 1]
        leave(leaving, members, count - 1, case.pixels, owners)
        without = paired(members, count - 1, case)
        if unpaired_gain(leaving, members, count - 1, owners, case) + pairs - without < -GAINED:
            inside[leaving] = False
            count -= 1
            pairs = without
        else:
            members[a] = leaving
            come_in(leaving, case.pixels, owners)
            a += 1
    wipe_owners(members, count, case.pixels, owners)
    return count


@kernel
def _exchange(members: Ints, count: int, own: Ints, inside: Flags, owners: Owners, case: Problem) -> bool:
    """Replace each member by the near candidate that raises the score most."""
    changed = False
    fill_owners(members, count, case.pixels, owners)
    for a in range(count):
        old = members[a]
        members[a] = members[count - 1]
        leave(old, members, count - 1, case.pixels, owners)
        pairs = paired(members, count - 1, case)
        best, best_gain = old, gain_of(old, members, count - 1, pairs, owners, case) + GAINED
        for i in own:
            if inside[i] or _apart(i, old, case) > _NEAR:
                continue
            gain = gain_of(i, members, count - 1, pairs, owners, case)
            if gain > best_gain:
                best, best_gain = i, gain
        members[count - 1] = members[a]
        members[a] = best
        come_in(best, case.pixels, owners)
        if best != old:
            inside[old], inside[best] = False, True
            changed = True
    wipe_owners(members, count, case.pixels, owners)
    return changed
