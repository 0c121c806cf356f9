"""Which candidates may continue which tracks, and the gain of one more person from the assignment of tracks.

The assignment of a set is kept. One more person takes a track, whose holder takes another or none, and so on: the gain
is that of the best such path, and an assignment that is best before is best after it (Kuhn 1955).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.evidence.ragged_lists import Lists, append, lists_of
from stseg.kernels.accelerate import kernel, part

_ROUNDING = 1e-12
"""Longer paths are better only by more, nats."""


class TrackSharing(NamedTuple):
    """Tracks of candidates, and their assignment to a set.

    Attributes
    ----------
    may
        The tracks that each candidate gains by, with that gain beside a birth, nats.
    holder : int64 (track,), worth : float64 (track,)
        The member who continues each track, -1 for none, and the gain of that.
    reached : int64 (track,), gain : float64 (track,), before : int64 (track,)
        Scratch: tracks on paths, the gain where a path ends at each, -inf before and after, and the one before it.
    """

    may: Lists
    holder: Ints
    worth: Floats
    reached: Ints
    gain: Floats
    before: Ints


@kernel
def track_sharing(track_gain: Floats, birth_cost: Floats) -> TrackSharing:
    """The tracks of candidates, of which nobody continues any, by gains (candidate, track) and costs of births."""
    candidates, tracks = track_gain.shape
    number = np.zeros(candidates, np.int64)
    for i in range(candidates):
        for k in range(tracks):
            number[i] += birth_cost[i] + track_gain[i, k] > 0.0
    may, place = lists_of(number)
    for i in range(candidates):
        for k in range(tracks):
            if birth_cost[i] + track_gain[i, k] > 0.0:
                append(may, place, i, k, birth_cost[i] + track_gain[i, k])
    nobody = np.full(tracks, -1, np.int64)
    return TrackSharing(may, nobody, np.zeros(tracks), nobody.copy(), np.full(tracks, -np.inf), nobody.copy())


@kernel
def assign_tracks(members: Ints, count: int, sharing: TrackSharing) -> None:
    """Assign tracks to the first `count` members, one to one, at the greatest sum."""
    sharing.holder[:] = -1
    for a in range(count):
        assign_track(members[a], sharing)


@kernel
def assign_track(i: int, sharing: TrackSharing) -> None:
    """Assign tracks to one more member."""
    number = _reach(i, sharing)
    k, _ = _best_end(number, sharing)
    while k >= 0:
        before = sharing.before[k]
        one = i if before < 0 else sharing.holder[before]
        sharing.holder[k], sharing.worth[k] = one, _worth(one, k, sharing.may)
        k = before
    _forget(number, sharing)


@part
def gain_of_track(i: int, sharing: TrackSharing) -> float:
    """Gain of candidate i from the assignment of tracks, nats."""
    number = _reach(i, sharing)
    _, gain = _best_end(number, sharing)
    _forget(number, sharing)
    return gain


@part
def _reach(i: int, sharing: TrackSharing) -> int:
    """Find the best path from candidate i to each track; returns how many tracks have one."""
    may, gain, reached = sharing.may, sharing.gain, sharing.reached
    number = 0
    for k in range(may.start[i], may.start[i + 1]):
        gain[may.item[k]], sharing.before[may.item[k]] = may.value[k], -1
        reached[number] = may.item[k]
        number += 1
    changed = True
    while changed:
        changed, done = False, 0
        while done < number:
            track = reached[done]
            done += 1
            one = sharing.holder[track]
            if one < 0:
                continue
            for k in range(may.start[one], may.start[one + 1]):
                other, value = may.item[k], gain[track] - sharing.worth[track] + may.value[k]
                if value > gain[other] + _ROUNDING:
                    if gain[other] == -np.inf:
                        reached[number] = other
                        number += 1
                    gain[other], sharing.before[other], changed = value, track, True
    return number


@part
def _best_end(number: int, sharing: TrackSharing) -> tuple[int, float]:
    """The track at which the best path ends, -1 for none that gains, and its gain, nats."""
    best, best_gain = -1, 0.0
    for r in range(number):
        track = sharing.reached[r]
        gain = sharing.gain[track]
        if sharing.holder[track] >= 0:
            gain -= sharing.worth[track]
        if gain > best_gain:
            best, best_gain = track, gain
    return best, best_gain


@part
def _worth(i: int, track: int, may: Lists) -> float:
    """Gain of candidate i as the continuation of a track that it may continue, nats."""
    k = may.start[i]
    while may.item[k] != track:
        k += 1
    return float(may.value[k])


@part
def _forget(number: int, sharing: TrackSharing) -> None:
    for r in range(number):
        sharing.gain[sharing.reached[r]] = -np.inf
