"""A set of candidates with the assignment of its evidence: gains of single moves without scoring the set anew.

The gain of a candidate is the difference of two scores (`scoring.set_score`). One more member changes the assignment of
pixels only inside its outline, that of boxes only among the members linked to it (`box_state`), and that of tracks
along one path (`track_state`): with the set's assignment at hand, the gain is a sum over these alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Ints
from stseg.detection.problem import DetectionProblem
from stseg.detection.score.box_state import BoxState, box_gain, box_state, clear_dependents
from stseg.detection.score.scoring import pair_cost, set_score
from stseg.detection.score.track_state import TrackAssignment, assign_track, assign_tracks, track_gain, track_state
from stseg.kernels.accelerate import kernel, part


class SetState(NamedTuple):
    """A set of candidates of a problem, to which members are added, and from which they are removed."""

    problem: DetectionProblem
    """The candidates; `owner` is the set's assignment of pixels, from `assign_pixels_and_tracks` to `release`."""
    members: Ints
    """int64 (candidate + 1,): the first `size[0]` are the set."""
    size: Ints
    """int64 (1,)."""
    inside: Flags
    """bool (candidate,): the set, and members of groups that do not interact with it."""
    boxes: BoxState
    """Links of candidates through boxes, and what is cached of the set."""
    tracks: TrackAssignment
    """The assignment of tracks to the set."""


@kernel
def set_state(problem: DetectionProblem) -> SetState:
    """The empty set of a problem's candidates."""
    candidates = len(problem.size_prior)
    return SetState(
        problem, np.empty(candidates + 1, np.int64), np.zeros(1, np.int64), np.zeros(candidates, np.bool_),
        box_state(problem.boxes, problem.parameters), track_state(problem.track_gain, problem.birth_cost),
    )  # fmt: skip


@kernel
def score(state: SetState) -> float:
    """Score of the set, nats."""
    return set_score(state.members, state.size[0], state.problem)


@kernel
def assign_pixels_and_tracks(state: SetState) -> None:
    """Assign pixels, of which none is assigned, and tracks to the members, in their order."""
    for a in range(state.size[0]):
        _assign_pixels(state.members[a], state)
    assign_tracks(state.members, state.size[0], state.tracks)


@kernel
def release(state: SetState) -> None:
    """Assign no pixel again."""
    pixels, owner = state.problem.pixels, state.problem.owner
    for a in range(state.size[0]):
        i = state.members[a]
        for view in range(len(pixels.raster)):
            for k in range(_rows(view, i, state)):
                line = (pixels.first[view, i] + k) * pixels.raster.shape[2]
                for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                    owner[view, line + u] = -1


@kernel
def gain(i: int, state: SetState, use_cache: bool) -> float:
    """Gain of candidate i, which is outside the assigned set, nats.

    The cache of box scores serves while the set is that of its last changes (`changed`), whether or not i itself was in
    it. For a candidate in place of a member that is put back (`put`), it is not used.
    """
    problem = state.problem
    total = problem.parameters.prior_log_odds + problem.size_prior[i] - problem.birth_cost[i]
    for a in range(state.size[0]):
        total -= pair_cost(i, state.members[a], problem)
    total += _pixel_gain(i, state)
    total += track_gain(i, state.tracks)
    return float(total + box_gain(i, state.inside, state.boxes, problem.parameters, use_cache))


@kernel
def add(i: int, state: SetState) -> None:
    """Add candidate i to the assigned set, as its last member."""
    changed(i, state)
    put(i, state.size[0], state)


@kernel
def changed(i: int, state: SetState) -> None:
    """Clear the cached box scores that depend on candidate i, which has left the set or is to join it."""
    clear_dependents(i, state.inside, state.boxes)


@kernel
def put(i: int, place: int, state: SetState) -> None:
    """Put candidate i at a place of the assigned set; the member there becomes the last one."""
    members, size = state.members, state.size
    members[size[0]] = members[place]
    members[place], state.inside[i] = i, True
    size[0] += 1
    _assign_pixels(i, state)
    assign_track(i, state.tracks)


@kernel
def withdraw(place: int, state: SetState) -> int:
    """Take the member at a place out of the assigned set; the last member moves there. Returns the candidate."""
    members, size, i = state.members, state.size, int(state.members[place])
    size[0] -= 1
    members[place], state.inside[i] = members[size[0]], False
    _reassign_pixels(i, state)
    assign_tracks(members, size[0], state.tracks)
    return i


@part
def _rows(view: int, i: int, state: SetState) -> int:
    """Rows of candidate i's outline that may lie on a view's raster."""
    first, pixels = state.problem.pixels.first[view, i], state.problem.pixels
    return min(pixels.spans.shape[2], pixels.raster.shape[1] - first) if first >= 0 else 0


@kernel
def _assign_pixels(i: int, state: SetState) -> None:
    """Assign to candidate i all pixels that no nearer member covers."""
    pixels, owner = state.problem.pixels, state.problem.owner
    for view in range(len(pixels.raster)):
        distance = pixels.distance[view]
        for k in range(_rows(view, i, state)):
            line = (pixels.first[view, i] + k) * pixels.raster.shape[2]
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = owner[view, line + u]
                if before < 0 or distance[before] > distance[i]:
                    owner[view, line + u] = i


@part
def _reassign_pixels(i: int, state: SetState) -> None:
    """Reassign candidate i's pixels to the nearest of the members that covers each."""
    pixels, owner = state.problem.pixels, state.problem.owner
    for view in range(len(pixels.raster)):
        first, spans, distance = pixels.first[view], pixels.spans[view], pixels.distance[view]
        rows = _rows(view, i, state)
        for k in range(rows):
            line = (first[i] + k) * pixels.raster.shape[2]
            for u in range(spans[i, k, 0], spans[i, k, 1]):
                if owner[view, line + u] == i:
                    owner[view, line + u] = -1
        for a in range(state.size[0]):
            j = state.members[a]
            lower = first[j] - first[i]
            for k in range(max(lower, 0), min(rows, lower + spans.shape[1]) if first[j] >= 0 else 0):
                line, below = (first[i] + k) * pixels.raster.shape[2], k - lower
                for u in range(max(spans[i, k, 0], spans[j, below, 0]), min(spans[i, k, 1], spans[j, below, 1])):
                    before = owner[view, line + u]
                    if before < 0 or distance[before] > distance[j]:
                        owner[view, line + u] = j


@part
def _pixel_gain(i: int, state: SetState) -> float:
    """Change of the pixel score of all views when candidate i joins the set, nats."""
    pixels, owner = state.problem.pixels, state.problem.owner
    total = 0.0
    for view in range(len(pixels.raster)):
        first, raster, distance = pixels.first[view, i], pixels.raster[view], pixels.distance[view]
        scale, area = pixels.scale[view], pixels.area[view]
        if first < 0:
            continue
        gained = 0.0
        for k in range(_rows(view, i, state)):
            line = (first + k) * pixels.raster.shape[2]
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = owner[view, line + u]
                if before < 0 or distance[before] > distance[i]:
                    gained += raster[first + k, u] / max(area[i], scale[first + k, u])
                if before >= 0 and distance[before] > distance[i]:
                    gained -= raster[first + k, u] / max(area[before], scale[first + k, u])
        total += gained
    return float(state.problem.parameters.effective_observations * total)
