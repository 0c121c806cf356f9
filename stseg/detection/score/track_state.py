"""Tracks of a set: their assignment to the members, and the gain of one more member from it.

One more member takes a track, the member before takes another or none, and so on: the gain is that of the best such
augmenting path, and an assignment that is best before is best after it (Kuhn 1955).
"""

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import RaggedArray, append, ragged_array
from stseg.kernels.accelerate import kernel, part

_ROUNDING_MARGIN = 1e-12
"""Longer paths are better only by more, nats."""


class TrackAssignment(NamedTuple):
    """Tracks of candidates, and their assignment to a set."""

    gains: RaggedArray
    """The tracks that each candidate gains by, with the gain against a birth, nats."""
    followers: RaggedArray
    """The candidates that gain by each track, with that gain."""
    member_of: Ints
    """int64 (track,): the member that continues each track, -1 for none."""
    member_gain: Floats
    """float64 (track,): the gain of that, nats."""
    reached: Ints
    """int64 (track,): scratch: tracks on paths."""
    path_gain: Floats
    """float64 (track,): scratch: the gain where a path ends at each track, -inf before and after."""
    before: Ints
    """int64 (track,): scratch: the track before each on its path."""


@kernel
def track_state(track_gain: Floats, birth_cost: Floats) -> TrackAssignment:
    """The tracks of candidates, without members, by gains (candidate, track) and costs of births (candidate,)."""
    candidates, tracks = track_gain.shape
    number, followed = np.zeros(candidates, np.int64), np.zeros(tracks, np.int64)
    for i in range(candidates):
        for k in range(tracks):
            if birth_cost[i] + track_gain[i, k] > 0.0:
                number[i] += 1
                followed[k] += 1
    (gains, place), (followers, next_place) = ragged_array(number), ragged_array(followed)
    for i in range(candidates):
        for k in range(tracks):
            if birth_cost[i] + track_gain[i, k] > 0.0:
                append(gains, place, i, k, birth_cost[i] + track_gain[i, k])
                append(followers, next_place, k, i, birth_cost[i] + track_gain[i, k])
    none, nothing = np.full(tracks, -1, np.int64), np.full(tracks, -np.inf)
    return TrackAssignment(gains, followers, none, np.zeros(tracks), none.copy(), nothing, none.copy())


@kernel
def assign_track(i: int, state: TrackAssignment) -> None:
    """Assign tracks to one more member."""
    number = _find_paths(i, state)
    k, _ = _best_end(number, state)
    while k >= 0:
        before = state.before[k]
        one = i if before < 0 else state.member_of[before]
        state.member_of[k], state.member_gain[k] = one, _gain_of(one, k, state.gains)
        k = before
    _clear_paths(number, state)


@kernel
def release_track(i: int, inside: Flags, state: TrackAssignment) -> None:
    """Assign the track of candidate i, which has left the set, inside (candidate,), where the sum is greatest.

    Another member takes it, its track goes to a third, and so on: the best path from the free track on.
    """
    followers, path_gain, reached = state.followers, state.path_gain, state.reached
    free = _track_of(i, state)
    if free < 0:
        return
    path_gain[free], state.before[free], reached[0], number, is_longer = 0.0, -1, free, 1, True
    while is_longer:
        is_longer, done = False, 0
        while done < number:
            track = reached[done]
            done += 1
            for k in range(followers.start[track], followers.start[track + 1]):
                if not inside[followers.item[k]]:
                    continue
                other = _track_of(followers.item[k], state)
                if other < 0 or other == track:
                    continue
                value = path_gain[track] + followers.value[k] - state.member_gain[other]
                if value > path_gain[other] + _ROUNDING_MARGIN:
                    if path_gain[other] == -np.inf:
                        reached[number] = other
                        number += 1
                    path_gain[other], state.before[other], is_longer = value, track, True
    end, joining, best = free, -1, 0.0
    for r in range(number):
        track = reached[r]
        if path_gain[track] > best:
            end, joining, best = track, -1, path_gain[track]
        for k in range(followers.start[track], followers.start[track + 1]):
            j = followers.item[k]
            if path_gain[track] + followers.value[k] > best and inside[j] and _track_of(j, state) < 0:
                end, joining, best = track, j, path_gain[track] + followers.value[k]
    while end >= 0:
        leaving = state.member_of[end]
        state.member_of[end] = joining
        if joining >= 0:
            state.member_gain[end] = _gain_of(joining, end, state.gains)
        joining, end = leaving, state.before[end]
    _clear_paths(number, state)


@part
def linked_tracks(i: int, inside: Flags, state: TrackAssignment) -> int:
    """Fill `reached` with the tracks that i, or members of the set linked to i by tracks, may continue: how many."""
    gains, followers, reached, is_reached = state.gains, state.followers, state.reached, state.path_gain
    number, done = 0, 0
    for k in range(gains.start[i], gains.start[i + 1]):
        reached[number], is_reached[gains.item[k]] = gains.item[k], 0.0
        number += 1
    while done < number:
        track = reached[done]
        done += 1
        for m in range(followers.start[track], followers.start[track + 1]):
            j = followers.item[m]
            for k in range(gains.start[j], gains.start[j + 1] if inside[j] else 0):
                if is_reached[gains.item[k]] < 0.0:
                    reached[number], is_reached[gains.item[k]] = gains.item[k], 0.0
                    number += 1
    _clear_paths(number, state)
    return number


@part
def track_after(i: int, state: TrackAssignment) -> int:
    """The track that candidate i would continue as a further member, -1 for none."""
    number = _find_paths(i, state)
    end, _ = _best_end(number, state)
    while end >= 0 and state.before[end] >= 0:
        end = state.before[end]
    _clear_paths(number, state)
    return end


@part
def _track_of(i: int, state: TrackAssignment) -> int:
    """The track that a candidate continues, -1 for none."""
    for k in range(state.gains.start[i], state.gains.start[i + 1]):
        if state.member_of[state.gains.item[k]] == i:
            return int(state.gains.item[k])
    return -1


@part
def track_gain(i: int, state: TrackAssignment) -> float:
    """Gain of candidate i from the assignment of tracks, nats."""
    number = _find_paths(i, state)
    _, gain = _best_end(number, state)
    _clear_paths(number, state)
    return gain


@part
def _find_paths(i: int, state: TrackAssignment) -> int:
    """Find the best path from candidate i to each track; returns how many tracks have one."""
    gains, path_gain, reached = state.gains, state.path_gain, state.reached
    number = 0
    for k in range(gains.start[i], gains.start[i + 1]):
        path_gain[gains.item[k]], state.before[gains.item[k]] = gains.value[k], -1
        reached[number] = gains.item[k]
        number += 1
    changed = True
    while changed:
        changed, done = False, 0
        while done < number:
            track = reached[done]
            done += 1
            one = state.member_of[track]
            if one < 0:
                continue
            for k in range(gains.start[one], gains.start[one + 1]):
                other, value = gains.item[k], path_gain[track] - state.member_gain[track] + gains.value[k]
                if value > path_gain[other] + _ROUNDING_MARGIN:
                    if path_gain[other] == -np.inf:
                        reached[number] = other
                        number += 1
                    path_gain[other], state.before[other], changed = value, track, True
    return number


@part
def _best_end(number: int, state: TrackAssignment) -> tuple[int, float]:
    """The track at which the best path ends, -1 for none that gains, and its gain, nats."""
    best, best_gain = -1, 0.0
    for r in range(number):
        track = state.reached[r]
        gain = state.path_gain[track]
        if state.member_of[track] >= 0:
            gain -= state.member_gain[track]
        if gain > best_gain:
            best, best_gain = track, gain
    return best, best_gain


@part
def _gain_of(i: int, track: int, gains: RaggedArray) -> float:
    """Gain of candidate i as the continuation of a track that it may continue, nats."""
    k = gains.start[i]
    while gains.item[k] != track:
        k += 1
    return float(gains.value[k])


@part
def _clear_paths(number: int, state: TrackAssignment) -> None:
    for r in range(number):
        state.path_gain[state.reached[r]] = -np.inf
