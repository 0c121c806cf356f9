"""Tracks of a set: their assignment to the members, and the gain of one more member from it.

One more member takes a track, the member before takes another or none, and so on: the gain is that of the best such
augmenting path, and an assignment that is best before is best after it (Kuhn 1955).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.problem import RaggedArray, append, ragged_array
from stseg.kernels.accelerate import kernel, part

_ROUNDING_MARGIN = 1e-12
"""Longer paths are better only by more, nats."""


class TrackAssignment(NamedTuple):
    """Tracks of candidates, and their assignment to a set."""

    gains: RaggedArray
    """The tracks that each candidate gains by, with the gain against a birth, nats."""
    member_of: Ints
    """int64 (track,): the member who continues each track, -1 for none."""
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
    number = np.zeros(candidates, np.int64)
    for i in range(candidates):
        for k in range(tracks):
            number[i] += birth_cost[i] + track_gain[i, k] > 0.0
    gains, place = ragged_array(number)
    for i in range(candidates):
        for k in range(tracks):
            if birth_cost[i] + track_gain[i, k] > 0.0:
                append(gains, place, i, k, birth_cost[i] + track_gain[i, k])
    none = np.full(tracks, -1, np.int64)
    return TrackAssignment(gains, none, np.zeros(tracks), none.copy(), np.full(tracks, -np.inf), none.copy())


@kernel
def assign_tracks(members: Ints, count: int, state: TrackAssignment) -> None:
    """Assign tracks to the first `count` members, one to one, at the greatest sum."""
    state.member_of[:] = -1
    for a in range(count):
        assign_track(members[a], state)


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
