"""Local search among the candidates of one group: simple moves, and swap moves.

Simple moves add, remove or replace one person. A swap forces one candidate out or in and lets simple moves answer
before the whole is judged: so one ghost gives way to the two people that it had taken evidence from, and two ghosts to
the one person who explains both.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.box_state import clear_cache
from stseg.detection.score.set_state import (
    SetState,
    add,
    assign_pixels_and_tracks,
    changed,
    gain,
    put,
    release,
    score,
    withdraw,
)
from stseg.kernels.accelerate import kernel, part

SCORE_TOLERANCE = 1e-9
"""Least rise of the score that counts, nats: above rounding errors."""
_SWEEP_LIMIT = 8
"""Sweeps of simple moves at most; two or three are usual."""
_REPLACEMENT_DISTANCE = 0.7
"""A member is replaced by candidates at most this far away, metres: more is another person."""
_RETRY_MARGIN = 3.0
"""Candidates that were this far below the best gain are not tried again in a sweep, nats."""
_INSERTION_GAIN = -12.0
"""Candidates with less gain are not forced in, nats: members that leave for them cannot make up for it."""


@kernel
def local_search(group: Ints, state: SetState) -> None:
    """Simple moves among the candidates of a group, int64 (n,), until none helps."""
    clear_cache(state.boxes)
    for _ in range(_SWEEP_LIMIT):
        size = state.size[0]
        _add_best(group, state)
        grown = state.size[0]
        _remove_worthless(-1, state.inside, state)
        shrunk = state.size[0]
        replaced = _replace(group, state)
        if grown == size and shrunk == grown and not replaced:
            break


@kernel
def swap_moves(group: Ints, interacts: Flags, sweeps: int, state: SetState) -> None:
    """Sweeps of swap moves until none helps; interacts (candidate, candidate) is that of `fill_interactions`."""
    members, inside, size = state.members.copy(), state.inside.copy(), state.size[0]
    best_score = score(state)
    for _ in range(sweeps):
        before = best_score
        for i in group:
            _become(members, inside, size, state)
            partners = group[interacts[i][group]]
            if inside[i]:
                is_changed = _remove_and_refill(i, partners[partners != i], state)
            else:
                is_changed = _insert_and_prune(i, interacts[i], state)
            if not is_changed:
                continue
            local_search(partners, state)
            after = score(state)
            if after > best_score + SCORE_TOLERANCE:
                size, best_score = state.size[0], after
                for a in range(size):
                    members[a] = state.members[a]
                for j in range(len(inside)):
                    inside[j] = state.inside[j]
        if best_score <= before + SCORE_TOLERANCE:
            break
    _become(members, inside, size, state)


@part
def _become(members: Ints, inside: Flags, size: int, state: SetState) -> None:
    """Make the state that of a set: in loops, since slices that are assigned to are slow to compile."""
    state.size[0] = size
    for a in range(size):
        state.members[a] = members[a]
    for i in range(len(inside)):
        state.inside[i] = inside[i]


@kernel
def _remove_and_refill(i: int, partners: Ints, state: SetState) -> bool:
    """Force member i out and add candidates that interact with it; whether any is added."""
    size = state.size[0] - 1
    for a in range(size):
        if state.members[a] == i:
            state.members[a] = state.members[size]
    state.size[0], state.inside[i] = size, False
    clear_cache(state.boxes)
    _add_best(partners, state)
    return bool(state.size[0] > size)


@kernel
def _insert_and_prune(i: int, partners: Flags, state: SetState) -> bool:
    """Force candidate i in and remove partners (candidate,) that add nothing to it; whether any is removed.

    Where just one nearby member is removed, that is a simple replacement, which was tried.
    """
    clear_cache(state.boxes)
    assign_pixels_and_tracks(state)
    is_worth = gain(i, state, True) >= _INSERTION_GAIN
    release(state)
    if not is_worth:
        return False
    before = state.members[: state.size[0]].copy()
    changed(i, state)
    state.members[state.size[0]], state.inside[i] = i, True
    state.size[0] += 1
    _remove_worthless(i, partners, state)
    removed = before[~state.inside[before]]
    return len(removed) > 1 or (len(removed) == 1 and _distance(i, removed[0], state.problem) > _REPLACEMENT_DISTANCE)


@part
def _distance(i: int, j: int, problem: DetectionProblem) -> float:
    return float(np.hypot(problem.ground[i, 0] - problem.ground[j, 0], problem.ground[i, 1] - problem.ground[j, 1]))


@kernel
def _add_best(group: Ints, state: SetState) -> None:
    """Add the best candidate while one helps; gains seldom rise, so candidates far below the best are tried once."""
    outside = 0
    for i in group:
        outside += not state.inside[i]
    if outside == 0:
        return
    gains = np.full(len(group), np.inf)
    assign_pixels_and_tracks(state)
    while True:
        best, best_gain = -1, SCORE_TOLERANCE
        for k in range(len(group)):
            if state.inside[group[k]] or gains[k] < best_gain - _RETRY_MARGIN:
                continue
            gains[k] = gain(group[k], state, True)
            if gains[k] > best_gain:
                best, best_gain = group[k], gains[k]
        if best < 0:
            break
        add(best, state)
    release(state)


@kernel
def _remove_worthless(fixed: int, removable: Flags, state: SetState) -> None:
    """Remove each member that lowers the score, of those that are removable (candidate,), but not `fixed`."""
    assign_pixels_and_tracks(state)
    a = 0
    while a < state.size[0]:
        if not removable[state.members[a]] or state.members[a] == fixed:
            a += 1
            continue
        i = withdraw(a, state)
        if gain(i, state, True) < -SCORE_TOLERANCE:
            changed(i, state)
        else:
            put(i, a, state)
            a += 1
    release(state)


@kernel
def _replace(group: Ints, state: SetState) -> bool:
    """Replace each member by the nearby candidate that raises the score most; whether any is replaced."""
    rivals = 0
    for a in range(state.size[0]):
        rivals += _has_rival(state.members[a], group, state)
    if rivals == 0:
        return False
    is_changed = False
    assign_pixels_and_tracks(state)
    for a in range(state.size[0]):
        if not _has_rival(state.members[a], group, state):
            continue
        member = withdraw(a, state)
        best, best_gain = member, gain(member, state, True) + SCORE_TOLERANCE
        for i in group:
            if i == member or not _may_replace(i, member, state):
                continue
            trial_gain = gain(i, state, False)
            if trial_gain > best_gain:
                best, best_gain = i, trial_gain
        if best != member:
            changed(member, state)
            changed(best, state)
            is_changed = True
        put(best, a, state)
    release(state)
    return is_changed


@part
def _has_rival(member: int, group: Ints, state: SetState) -> bool:
    """Whether any candidate may replace a member."""
    has_rival = False
    for i in group:
        has_rival = has_rival or _may_replace(i, member, state)
    return has_rival


@part
def _may_replace(i: int, member: int, state: SetState) -> bool:
    """Whether a candidate is outside the set and close to a member."""
    return not state.inside[i] and _distance(i, member, state.problem) <= _REPLACEMENT_DISTANCE
