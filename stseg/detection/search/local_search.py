"""Local search among the candidates of one group: simple moves, and swap moves.

Simple moves add, remove or replace one person. A swap forces one candidate out or in and lets simple moves answer
before the whole is judged: so one ghost gives way to the two people that it had taken evidence from, and two ghosts to
the one person who explains both.
"""

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.gains import gain
from stseg.detection.score.moves import add, copy_of, put, remove, return_to, withdraw
from stseg.detection.score.neighbours import REPLACEMENT_DISTANCE
from stseg.detection.score.set_state import NO_MEMBER, SetState
from stseg.detection.search.groups import mark_interacting
from stseg.kernels.accelerate import kernel, part

SCORE_TOLERANCE = 1e-9
"""Least rise of the score that counts, nats: above rounding errors."""
_SWEEP_LIMIT = 8
"""Sweeps of simple moves at most; two or three are usual."""
_RETRY_MARGIN = 3.0
"""Candidates that were this far below the best gain are not tried again in a sweep, nats."""
_INSERTION_GAIN = -12.0
"""Candidates with less gain are not forced in, nats: members that leave for them cannot make up for it."""


@kernel
def local_search(group: Ints, in_group: Flags, state: SetState) -> None:
    """Simple moves among the candidates of a group, int64 (n,) and bool (candidate,), until none helps.

    All searches end when no gains remain that may be computed.
    """
    for _ in range(_SWEEP_LIMIT if state.remaining[0] > 0 else 0):
        before = state.moves[0]
        _add_best(group, state)
        _remove_worthless(NO_MEMBER, state.inside, state)
        _replace(in_group, state)
        if state.moves[0] == before:
            break


@kernel
def swap_moves(group: Ints, sweeps: int, state: SetState) -> None:
    """Sweeps of swap moves until none helps, each tried again only where a gain changed on which it may depend."""
    candidates = len(state.inside)
    interacts, read = np.empty(candidates, np.bool_), np.zeros((candidates, candidates), np.bool_)
    tried = np.full(candidates, -1)
    for _ in range(sweeps):
        is_changed = False
        for i in group:
            if state.remaining[0] <= 0 or (tried[i] >= 0 and not _is_changed(read[i], tried[i], state)):
                continue
            mark_interacting(i, state, interacts)
            before, score, first = copy_of(state), state.total[0], state.moves[0]
            settled = state.settled.copy()
            if _forced(i, group, interacts, state):
                local_search(group[interacts[group]], interacts, state)
            for j in range(candidates):
                read[i, j] = interacts[j] or state.changed[j] > first
            if state.total[0] > score + SCORE_TOLERANCE:
                is_changed = True
                for j in range(candidates):  # in this search members were not replaced by all of the group
                    state.settled[j] = settled[j]
            else:
                return_to(before, state)
                tried[i] = state.moves[0]
        if not is_changed:
            break


@part
def _is_changed(read: Flags, since: int, state: SetState) -> bool:
    """Whether the gain of any candidate that is read (candidate,) has changed."""
    is_changed = False
    for j in range(len(read)):
        is_changed = is_changed or (read[j] and state.changed[j] > since)
    return is_changed


@kernel
def _forced(i: int, group: Ints, interacts: Flags, state: SetState) -> bool:
    """Force candidate i out or in, and let those answer that it interacts with; whether that is another set."""
    if state.inside[i]:
        return _remove_and_refill(i, group[interacts[group] & (group != i)], state)
    return _insert_and_prune(i, interacts, state)


@kernel
def _remove_and_refill(i: int, partners: Ints, state: SetState) -> bool:
    """Force member i out and add candidates that interact with it; whether any is added."""
    for a in range(state.size[0] - 1, -1, -1):
        if state.members[a] == i:
            remove(a, state)
    size = state.size[0]
    _add_best(partners, state)
    return bool(state.size[0] > size)


@kernel
def _insert_and_prune(i: int, partners: Flags, state: SetState) -> bool:
    """Force candidate i in and remove partners (candidate,) that add nothing to it; whether any is removed.

    Where just one nearby member is removed, that is a simple replacement, which was tried.
    """
    if gain(i, NO_MEMBER, state) < _INSERTION_GAIN:
        return False
    before = state.members[: state.size[0]].copy()
    add(i, state.size[0], state)
    _remove_worthless(i, partners, state)
    removed = before[~state.inside[before]]
    return len(removed) > 1 or (len(removed) == 1 and _distance(i, removed[0], state.problem) > REPLACEMENT_DISTANCE)


@part
def _distance(i: int, j: int, problem: DetectionProblem) -> float:
    return float(np.hypot(problem.ground[i, 0] - problem.ground[j, 0], problem.ground[i, 1] - problem.ground[j, 1]))


@kernel
def _add_best(group: Ints, state: SetState) -> None:
    """Add the best candidate while one helps; gains seldom rise, so candidates far below the best are tried once."""
    gains = np.full(len(group), np.inf)
    while state.remaining[0] > 0:
        best, best_gain = NO_MEMBER, SCORE_TOLERANCE
        for k in range(len(group)):
            if state.inside[group[k]] or gains[k] < best_gain - _RETRY_MARGIN:
                continue
            gains[k] = gain(group[k], NO_MEMBER, state)
            if gains[k] > best_gain:
                best, best_gain = group[k], gains[k]
        if best < 0:
            break
        add(best, state.size[0], state)


@kernel
def _remove_worthless(fixed: int, removable: Flags, state: SetState) -> None:
    """Remove each member that lowers the score, of those that are removable (candidate,), but not `fixed`."""
    a = 0
    while a < state.size[0] and state.remaining[0] > 0:
        i = state.members[a]
        if removable[i] and i != fixed and gain(i, NO_MEMBER, state) < -SCORE_TOLERANCE:
            remove(a, state)
        else:
            a += 1


@kernel
def _replace(in_group: Flags, state: SetState) -> None:
    """Replace each member by the candidate of a group near it that raises the score most.

    Where no gain of them has changed since none did, that is not tried again.
    """
    neighbours = state.problem.neighbours
    for a in range(state.size[0] if state.remaining[0] > 0 else 0):
        member, is_open = state.members[a], False
        for k in range(neighbours.start[member], neighbours.start[member + 1]):
            i = neighbours.item[k]
            newest = max(state.changed[i], state.changed[member])
            is_open = is_open or (newest > state.settled[member] and _may_replace(i, member, in_group, state))
        if not is_open:
            continue
        withdraw(a, state)
        best, best_gain = member, gain(member, NO_MEMBER, state) + SCORE_TOLERANCE
        for k in range(neighbours.start[member], neighbours.start[member + 1]):
            i = neighbours.item[k]
            if _may_replace(i, member, in_group, state):
                trial_gain = gain(i, member, state)
                if trial_gain > best_gain:
                    best, best_gain = i, trial_gain
        put(member, a, state)
        state.settled[member] = state.moves[0]
        if best != member:
            remove(a, state)
            add(best, a, state)


@part
def _may_replace(i: int, member: int, in_group: Flags, state: SetState) -> bool:
    """Whether a candidate of a group is outside the set and close to a member."""
    return bool(in_group[i] and not state.inside[i] and _distance(i, member, state.problem) <= REPLACEMENT_DISTANCE)
