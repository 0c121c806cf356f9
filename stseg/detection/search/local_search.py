"""Local search among the candidates of one group: simple moves, and swap moves.

Simple moves add, remove or replace one person. A swap forces one candidate out or in and lets simple moves answer
before the whole is judged: so one ghost gives way to the two people whose evidence it had taken, and two ghosts to the
one person who explains both.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.detection.problem import PixelAssignment, Problem
from stseg.detection.score.box_sharing import forget, forget_linked
from stseg.detection.score.gains import (
    clear_assignment,
    fill_assignment,
    gain_in_place,
    gain_of,
    insert,
    withdraw,
)
from stseg.detection.score.scoring import set_score
from stseg.detection.score.sharing import Sharing
from stseg.detection.score.track_sharing import assign_track, assign_tracks
from stseg.kernels.accelerate import kernel, part

SWEEPS = 8
"""Sweeps of simple moves at most; two or three are usual."""
GAINED = 1e-9
"""Least rise of the score that counts, nats: above rounding errors."""
_NEAR = 0.7
"""A member is replaced by candidates this near alone, metres: more is another person."""
_SLACK = 3.0
"""Candidates that were this far below the best gain are not tried again in a sweep, nats."""
_HOPELESS = -12.0
"""Candidates with less gain are not forced in, nats: members that leave for them cannot make up for it."""


@kernel
def local_search(
    members: Ints,
    count: int,
    own: Ints,
    inside: Flags,
    assigned: PixelAssignment,
    problem: Problem,
    sharing: Sharing,
) -> int:
    """Simple moves until none helps; returns the set's new size.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        The first `count` are the set.
    own : int64 (n,)
        The candidates of the group.
    inside : bool (candidate,)
        Membership of all candidates.
    assigned : int16 (view, v * u)
        Scratch, -1 everywhere before and after.
    """
    forget(sharing.boxes)
    for _ in range(SWEEPS):
        grown = _add(members, count, own, inside, assigned, problem, sharing)
        shrunk = _remove(members, grown, -1, inside, inside, assigned, problem, sharing)
        exchanged = _exchange(members, shrunk, own, inside, assigned, problem, sharing)
        if grown == count and shrunk == grown and not exchanged:
            break
        count = shrunk
    return count


@kernel
def swap(
    members: Ints,
    count: int,
    own: Ints,
    inside: Flags,
    interacts: Flags,
    assigned: PixelAssignment,
    trades: int,
    problem: Problem,
    sharing: Sharing,
) -> int:
    """Sweeps of swap moves until none helps; arguments of `local_search`, and `interacts` (candidate, candidate)."""
    trial, trial_inside = members.copy(), inside.copy()
    score = set_score(members, count, problem)
    for _ in range(trades):
        before = score
        for i in own:
            _become(trial, trial_inside, members, inside)
            near = own[interacts[i][own]]
            if inside[i]:
                size = _withdraw_and_refill(trial, count, i, near[near != i], trial_inside, assigned, problem, sharing)
            else:
                size = _insert_and_prune(trial, count, i, trial_inside, interacts, assigned, problem, sharing)
            if size < 0:
                continue
            size = local_search(trial, size, near, trial_inside, assigned, problem, sharing)
            after = set_score(trial, size, problem)
            if after > score + GAINED:
                _become(members, inside, trial, trial_inside)
                count, score = size, after
        if score <= before + GAINED:
            break
    return count


@part
def _become(members: Ints, inside: Flags, other: Ints, other_inside: Flags) -> None:
    """Make a set that of others: as loops, since assigned slices are checked by code that takes seconds to compile."""
    for a in range(len(members)):
        members[a] = other[a]
    for i in range(len(inside)):
        inside[i] = other_inside[i]


@kernel
def _withdraw_and_refill(
    members: Ints,
    count: int,
    i: int,
    near: Ints,
    inside: Flags,
    assigned: PixelAssignment,
    problem: Problem,
    sharing: Sharing,
) -> int:
    """Force member i out and add candidates near it; the set's size, or -1 where none is added."""
    for a in range(count):
        if members[a] == i:
            members[a] = members[count - 1]
    inside[i] = False
    forget(sharing.boxes)
    size = _add(members, count - 1, near, inside, assigned, problem, sharing)
    return size if size > count - 1 else -1


@kernel
def _insert_and_prune(
    members: Ints,
    count: int,
    i: int,
    inside: Flags,
    interacts: Flags,
    assigned: PixelAssignment,
    problem: Problem,
    sharing: Sharing,
) -> int:
    """Force candidate i in and remove members that add nothing beside it; the set's size, or -1 where none is removed.

    Where just one near member is removed, that is a simple replacement, which was tried.
    """
    forget(sharing.boxes)
    fill_assignment(members, count, problem.pixels, assigned)
    assign_tracks(members, count, sharing.tracks)
    gain = gain_of(i, members, count, inside, assigned, problem, sharing)
    clear_assignment(members, count, problem.pixels, assigned)
    if gain < _HOPELESS:
        return -1
    before = members[:count].copy()
    forget_linked(i, inside, sharing.boxes)
    members[count], inside[i] = i, True
    left = _remove(members, count + 1, i, interacts[i], inside, assigned, problem, sharing)
    gone = before[~inside[before]]
    if len(gone) == 0 or (len(gone) == 1 and _apart(i, gone[0], problem) <= _NEAR):
        return -1
    return left


@part
def _apart(i: int, j: int, problem: Problem) -> float:
    return float(np.hypot(problem.ground[i, 0] - problem.ground[j, 0], problem.ground[i, 1] - problem.ground[j, 1]))


@kernel
def _add(
    members: Ints,
    count: int,
    own: Ints,
    inside: Flags,
    assigned: PixelAssignment,
    problem: Problem,
    sharing: Sharing,
) -> int:
    """Add the best candidate while one helps; gains seldom rise, so candidates far below the best are tried once."""
    outside = 0
    for i in own:
        outside += not inside[i]
    if outside == 0:
        return count
    gain = np.full(len(own), np.inf)
    fill_assignment(members, count, problem.pixels, assigned)
    assign_tracks(members, count, sharing.tracks)
    while True:
        best, best_gain = -1, GAINED
        for k in range(len(own)):
            if inside[own[k]] or gain[k] < best_gain - _SLACK:
                continue
            gain[k] = gain_of(own[k], members, count, inside, assigned, problem, sharing)
            if gain[k] > best_gain:
                best, best_gain = own[k], gain[k]
        if best < 0:
            break
        forget_linked(best, inside, sharing.boxes)
        members[count], inside[best] = best, True
        count += 1
        insert(best, problem.pixels, assigned)
        assign_track(best, sharing.tracks)
    clear_assignment(members, count, problem.pixels, assigned)
    return count


@kernel
def _remove(
    members: Ints,
    count: int,
    keep: int,
    may: Flags,
    inside: Flags,
    assigned: PixelAssignment,
    problem: Problem,
    sharing: Sharing,
) -> int:
    """Remove each member without whom the score is higher, of those that `may` (candidate,) leave, but not `keep`."""
    fill_assignment(members, count, problem.pixels, assigned)
    a = 0
    while a < count:
        leaving = members[a]
        if not may[leaving] or leaving == keep:
            a += 1
            continue
        members[a] = members[count - 1]
        inside[leaving] = False
        withdraw(leaving, members, count - 1, problem.pixels, assigned)
        assign_tracks(members, count - 1, sharing.tracks)
        if gain_of(leaving, members, count - 1, inside, assigned, problem, sharing) < -GAINED:
            forget_linked(leaving, inside, sharing.boxes)
            count -= 1
        else:
            members[a], inside[leaving] = leaving, True
            insert(leaving, problem.pixels, assigned)
            a += 1
    clear_assignment(members, count, problem.pixels, assigned)
    return count


@kernel
def _exchange(
    members: Ints,
    count: int,
    own: Ints,
    inside: Flags,
    assigned: PixelAssignment,
    problem: Problem,
    sharing: Sharing,
) -> bool:
    """Replace each member by the near candidate that raises the score most."""
    rivals = 0
    for a in range(count):
        rivals += _has_rival(members[a], own, inside, problem)
    if rivals == 0:
        return False
    changed = False
    fill_assignment(members, count, problem.pixels, assigned)
    for a in range(count):
        old = members[a]
        if not _has_rival(old, own, inside, problem):
            continue
        members[a], inside[old] = members[count - 1], False
        withdraw(old, members, count - 1, problem.pixels, assigned)
        assign_tracks(members, count - 1, sharing.tracks)
        best, best_gain = old, gain_of(old, members, count - 1, inside, assigned, problem, sharing) + GAINED
        for i in own:
            if i == old or not _may_replace(i, old, inside, problem):
                continue
            gain = gain_in_place(i, members, count - 1, inside, assigned, problem, sharing)
            if gain > best_gain:
                best, best_gain = i, gain
        members[count - 1] = members[a]
        if best != old:
            forget_linked(old, inside, sharing.boxes)
            forget_linked(best, inside, sharing.boxes)
        members[a], inside[best] = best, True
        insert(best, problem.pixels, assigned)
        changed = changed or best != old
    clear_assignment(members, count, problem.pixels, assigned)
    return changed


@part
def _has_rival(old: int, own: Ints, inside: Flags, problem: Problem) -> bool:
    """Whether any candidate may replace a member."""
    found = False
    for i in own:
        found = found or _may_replace(i, old, inside, problem)
    return found


@part
def _may_replace(i: int, old: int, inside: Flags, problem: Problem) -> bool:
    """Whether a candidate is outside the set and near a member."""
    return not inside[i] and _apart(i, old, problem) <= _NEAR
