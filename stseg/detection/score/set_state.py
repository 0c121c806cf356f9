"""A set of candidates with the assignment of its evidence: gains of single moves without scoring the set anew.

The gain of a candidate is the difference of two scores (`scoring.set_score`). One more member changes the assignment of
pixels only inside its outline, that of boxes only among the members linked to it (`box_state`), and that of tracks
along one path (`track_state`): with the set's assignment at hand, the gain is a sum over these alone. Gains are kept,
view by view, until a member comes or goes that they depend on: the work of a move is that of its neighbourhood.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import DetectionProblem, PixelEvidence, RaggedArray
from stseg.detection.score.box_state import BoxState, box_gain, box_part, box_state, link
from stseg.detection.score.scoring import contact_limit, pair_cost
from stseg.detection.score.track_state import (
    TrackAssignment,
    assign_track,
    linked_tracks,
    release_track,
    track_after,
    track_gain,
    track_state,
)
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed

REPLACEMENT_DISTANCE = 0.7
"""A member is replaced by candidates at most this far away, metres: more is another person."""


class Kept(NamedTuple):
    """All that is known of a set: to a copy of it the set returns when moves are taken back (`return_to`)."""

    numbers: Ints
    values: Floats
    flags: Flags


class SetState(NamedTuple):
    """A set of candidates of a problem, to which members are added, and from which they are removed."""

    problem: DetectionProblem
    """The candidates; `owner` is the set's assignment of pixels, until `release`."""
    neighbours: RaggedArray
    """The others within the distance of replacements or of crowding, rising, with the cost of the pair, nats."""
    overlapping: RaggedArray
    """The others whose outlines share a pixel, rising; the row of a candidate in a view is view * candidates +
    candidate."""
    boxes: BoxState
    """Links of candidates through boxes."""
    tracks: TrackAssignment
    """The assignment of tracks to the set."""
    members: Ints
    """int64 (candidate + 1,): the first `size[0]` are the set."""
    size: Ints
    """int64 (1,)."""
    changed: Ints
    """int64 (candidate,): number of the last move that the gain of each depends on."""
    settled: Ints
    """int64 (candidate,): number of moves after which no replacement of a member helped, -1 if none was tried."""
    moves: Ints
    """int64 (1,): number of moves so far; one that is taken back counts."""
    remaining: Ints
    """int64 (1,): gains that may still be computed in a search."""
    total: Floats
    """float64 (1,): sum of the gains of all moves, nats."""
    gains: Floats
    """float64 (part * candidate,): what each candidate gains by, or a member is worth: parts of views with boxes and
    with pixels, the latter for a weight of 1; last the whole. Nats."""
    inside: Flags
    """bool (candidate,): the set, and members of groups that do not interact with it."""
    is_known: Flags
    """bool (part * candidate,): whether that is the gain in the set as it is."""
    kept: Kept
    """The arrays of all fields from `members` on but the two numbers of moves and remaining gains."""


@kernel
def set_state(problem: DetectionProblem) -> SetState:
    """The empty set of a problem's candidates."""
    candidates = len(problem.size_prior)
    boxes, tracks = box_state(problem.boxes, problem.parameters), track_state(problem.track_gain, problem.birth_cost)
    parts = (boxes.views + len(problem.pixels.raster) + 1) * candidates
    numbers = np.zeros(3 * candidates + 2, np.int64)
    for i in range(candidates):
        numbers[2 * candidates + 2 + i] = -1
    kept = Kept(numbers, np.zeros(parts + 1), np.zeros(candidates + parts, np.bool_))
    return SetState(
        problem, _neighbours(problem), _overlapping(problem.pixels), boxes, tracks, numbers[: candidates + 1],
        numbers[candidates + 1 : candidates + 2], numbers[candidates + 2 : 2 * candidates + 2],
        numbers[2 * candidates + 2 :], np.zeros(1, np.int64), np.zeros(1, np.int64), kept.values[:1],
        kept.values[1:], kept.flags[:candidates], kept.flags[candidates:], kept,
    )  # fmt: skip


@kernel
def fill_gains(
    members: Ints, candidates: Ints, problem: DetectionProblem, gains: Floats, view_evidence: Floats, tracks: Ints
) -> None:
    """Fill gains (k,) with those of some candidates, int64 (k,), in the set of the members, int64 (n,): nats.

    Of candidates outside it, `view_evidence` float64 (view, k) and `tracks` int64 (k,) are filled, too: what
    `fill_evidence` says of each.
    """
    _fill_gains(members, candidates, set_state(problem), gains, view_evidence, tracks)


@kernel
def _fill_gains(
    members: Ints, candidates: Ints, whole: SetState, gains: Floats, view_evidence: Floats, tracks: Ints
) -> None:
    state = pointed(whole)
    for i in members:
        put(i, state.size[0], state)
    for k in range(len(candidates)):
        gains[k] = gain(candidates[k], -1, state)
        if not state.inside[candidates[k]]:
            tracks[k] = fill_evidence(candidates[k], state, view_evidence[:, k])
    release(state)


@kernel
def _neighbours(problem: DetectionProblem) -> RaggedArray:
    ground, candidates = problem.ground, len(problem.ground)
    start, number = np.zeros(candidates + 1, np.int64), 0
    item, value = np.empty(candidates * candidates, np.int64), np.empty(candidates * candidates)
    reach = max(REPLACEMENT_DISTANCE, contact_limit(problem))
    for i in range(candidates):
        for j in range(candidates):
            if max(abs(ground[i, 0] - ground[j, 0]), abs(ground[i, 1] - ground[j, 1])) > reach:
                continue
            cost = pair_cost(i, j, problem)
            distance = np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1])
            if i != j and (cost > 0 or distance <= REPLACEMENT_DISTANCE):
                item[number], value[number] = j, cost
                number += 1
        start[i + 1] = number
    return RaggedArray(start, item[:number].copy(), value[:number].copy())


@kernel
def _overlapping(pixels: PixelEvidence) -> RaggedArray:
    (views, candidates), most = pixels.first.shape, pixels.spans.shape[2]
    start, number, nothing = np.zeros(views * candidates + 1, np.int64), 0, np.empty(0)
    item = np.empty(views * candidates * candidates, np.int64)  # what is not filled takes no memory
    left, right = np.empty((2, candidates), np.int64)
    for view in range(views):
        first, spans = pixels.first[view], pixels.spans[view]
        for i in range(candidates):
            left[i], right[i] = pixels.raster.shape[2], 0
            for row in range(most if first[i] >= 0 else 0):
                if spans[i, row, 0] < spans[i, row, 1]:
                    left[i], right[i] = min(left[i], spans[i, row, 0]), max(right[i], spans[i, row, 1])
        for i in range(candidates):
            for j in range(candidates):
                if i == j or max(left[i], left[j]) >= min(right[i], right[j]):
                    continue
                for row in range(max(first[i], first[j]), min(first[i], first[j]) + most):
                    a, b = spans[i, row - first[i]], spans[j, row - first[j]]
                    if max(a[0], b[0]) < min(a[1], b[1]):
                        item[number] = j
                        number += 1
                        break
            start[view * candidates + i + 1] = number
    return RaggedArray(start, item[:number].copy(), nothing)


@kernel
def copy_of(state: SetState) -> Kept:
    """All that is known of a set now."""
    return Kept(state.kept.numbers.copy(), state.kept.values.copy(), state.kept.flags.copy())


@kernel
def return_to(before: Kept, state: SetState) -> None:
    """Take back the moves since a copy was made, without forgetting the gains of then."""
    for a in range(state.size[0] - 1, -1, -1):
        if not before.flags[state.members[a]]:
            withdraw(a, state)
    for i in range(len(state.inside)):
        if before.flags[i] and not state.inside[i]:
            put(i, state.size[0], state)
    for k in range(len(before.numbers)):  # in loops, since slices that are assigned to are slow to compile
        state.kept.numbers[k] = before.numbers[k]
    for k in range(len(before.values)):
        state.kept.values[k] = before.values[k]
    for k in range(len(before.flags)):
        state.kept.flags[k] = before.flags[k]


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
def gain(i: int, absent: int, state: SetState) -> float:
    """Gain of candidate i as a further member, or what member i is worth, nats; it is kept until a move changes it.

    With a member who is `absent` for the while (`withdraw`, then `put` without a move), what depends on that member is
    computed and not kept; -1 where all are there.
    """
    problem, boxes, is_member = state.problem, state.boxes, state.inside[i]
    candidates, views = len(state.inside), len(problem.pixels.raster)
    whole = (boxes.views + views) * candidates + i
    if absent < 0 and state.is_known[whole]:
        return float(state.gains[whole])
    state.remaining[0] -= 1
    total = problem.parameters.prior_log_odds + problem.size_prior[i] - problem.birth_cost[i]
    for k in range(state.neighbours.start[i], state.neighbours.start[i + 1]):
        total -= state.neighbours.value[k] if state.inside[state.neighbours.item[k]] else 0.0
    pixel_sum = 0.0
    for view in range(views):
        row = view * candidates + i
        known = boxes.views * candidates + row
        is_kept = absent < 0 or not _overlaps(row, absent, state.overlapping)
        if is_kept and state.is_known[known]:
            pixel_sum += state.gains[known]
            continue
        if is_member:
            _reassign_pixels(view, i, state)
        gained = _pixel_gain(view, i, state)
        if is_member:
            _assign_in_view(view, i, state)
        if is_kept:
            state.gains[known], state.is_known[known] = gained, True
        pixel_sum += gained
    total += problem.parameters.effective_observations * pixel_sum
    state.inside[i] = False
    if is_member:
        release_track(i, state.inside, state.tracks)
    total += track_gain(i, state.tracks)
    if is_member:
        assign_track(i, state.tracks)
    for view in range(boxes.views):
        row = view * candidates + i
        if absent >= 0:
            total += box_gain(view, i, state.inside, boxes, problem.parameters)
            continue
        if not state.is_known[row]:
            state.gains[row] = box_gain(view, i, state.inside, boxes, problem.parameters)
            state.is_known[row] = True
        total += state.gains[row]
    state.inside[i] = is_member
    if absent < 0:
        state.gains[whole], state.is_known[whole] = total, True
    return float(total)


@part
def _overlaps(row: int, j: int, overlapping: RaggedArray) -> bool:
    """Whether candidate j is in a row of overlaps."""
    overlaps = False
    for k in range(overlapping.start[row], overlapping.start[row + 1]):
        overlaps = overlaps or overlapping.item[k] == j
    return overlaps


@kernel
def fill_evidence(i: int, state: SetState, parts: Floats) -> int:
    """Fill parts (view,) with the evidence of each view for candidate i as a further member, nats; returns its track.

    That is the number of a predicted track, -1 for a birth. Views with boxes come first.
    """
    problem, boxes = state.problem, state.boxes
    pixels, owner = problem.pixels, problem.owner
    for view in range(boxes.views):
        parts[view] = box_part(view, i, state.inside, boxes, problem.parameters)
    for view in range(len(pixels.raster)):
        first, distance, evidence = pixels.first[view, i], pixels.distance[view], 0.0
        for k in range(_rows(view, i, state)):
            line = (first + k) * pixels.raster.shape[2]
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = owner[view, line + u]
                if before < 0 or distance[before] > distance[i]:
                    evidence += pixels.raster[view, first + k, u] / max(
                        pixels.area[view, i], pixels.scale[view, first + k, u]
                    )
        parts[boxes.views + view] = problem.parameters.effective_observations * evidence
    return track_after(i, state.tracks)


@kernel
def add(i: int, place: int, state: SetState) -> None:
    """Add candidate i to the set at a place, from where the member goes to the last one."""
    state.total[0] += gain(i, -1, state)
    _forget(i, state)
    put(i, place, state)


@kernel
def remove(place: int, state: SetState) -> None:
    """Remove the member at a place from the set; the last member moves there."""
    state.total[0] -= gain(state.members[place], -1, state)
    _forget(withdraw(place, state), state)


@kernel
def put(i: int, place: int, state: SetState) -> None:
    """Put candidate i at a place of the set, and back again after it was withdrawn from it; gains are kept."""
    members, size = state.members, state.size
    members[size[0]] = members[place]
    members[place], state.inside[i] = i, True
    size[0] += 1
    _assign_pixels(i, state)
    assign_track(i, state.tracks)


@kernel
def withdraw(place: int, state: SetState) -> int:
    """Take the member at a place out of the set, and keep the gains; returns the candidate."""
    members, size, i = state.members, state.size, int(state.members[place])
    size[0] -= 1
    members[place], state.inside[i] = members[size[0]], False
    for view in range(len(state.problem.pixels.raster)):
        _reassign_pixels(view, i, state)
    release_track(i, state.inside, state.tracks)
    return i


@kernel
def _forget(i: int, state: SetState) -> None:
    """Forget the gains that depend on whether candidate i, outside now, is in the set."""
    candidates, boxes, overlapping, tracks = len(state.inside), state.boxes, state.overlapping, state.tracks
    state.moves[0] += 1
    whole = boxes.views + len(state.problem.pixels.raster)
    _forget_part(whole, i, state)
    for k in range(state.neighbours.start[i], state.neighbours.start[i + 1]):
        if state.neighbours.value[k] > 0:
            _forget_part(whole, state.neighbours.item[k], state)
    for row in range(i, len(overlapping.start) - 1, candidates):
        _forget_row(boxes.views + row // candidates, row, overlapping, state)
    for r in range(linked_tracks(i, state.inside, tracks)):
        _forget_row(whole, tracks.reached[r], tracks.followers, state)
    for view in range(boxes.views):
        _forget_row(view, view * candidates + i, boxes.hidden, state)
        for a in range(link(view, i, state.inside, boxes)):
            row = view * candidates + boxes.linked[a]
            _forget_row(view, row, boxes.hiders, state)
            for k in range(boxes.fits.start[row], boxes.fits.start[row + 1]):
                _forget_row(view, view * boxes.boxes + boxes.fits.item[k], boxes.fitting, state)


@part
def _forget_row(number: int, row: int, rows: RaggedArray, state: SetState) -> None:
    """Forget a part of the gains of all candidates of a row."""
    for k in range(rows.start[row], rows.start[row + 1]):
        _forget_part(number, rows.item[k], state)


@part
def _forget_part(number: int, i: int, state: SetState) -> None:
    """Forget a part of a candidate's gain, and the whole."""
    candidates = len(state.inside)
    state.is_known[number * candidates + i] = state.is_known[len(state.is_known) - candidates + i] = False
    state.changed[i] = state.moves[0]


@part
def _rows(view: int, i: int, state: SetState) -> int:
    """Rows of candidate i's outline that may lie on a view's raster."""
    first, pixels = state.problem.pixels.first[view, i], state.problem.pixels
    return min(pixels.spans.shape[2], pixels.raster.shape[1] - first) if first >= 0 else 0


@kernel
def _assign_pixels(i: int, state: SetState) -> None:
    """Assign to candidate i all pixels that no nearer member covers."""
    for view in range(len(state.problem.pixels.raster)):
        _assign_in_view(view, i, state)


@part
def _assign_in_view(view: int, i: int, state: SetState) -> None:
    """The same in one view."""
    pixels, owner = state.problem.pixels, state.problem.owner
    distance = pixels.distance[view]
    for k in range(_rows(view, i, state)):
        line = (pixels.first[view, i] + k) * pixels.raster.shape[2]
        for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
            before = owner[view, line + u]
            if before < 0 or distance[before] > distance[i]:
                owner[view, line + u] = i


@kernel
def _reassign_pixels(view: int, i: int, state: SetState) -> None:
    """Reassign candidate i's pixels of a view to the nearest of the other members that covers each."""
    pixels, owner, overlapping = state.problem.pixels, state.problem.owner[view], state.overlapping
    first, spans, distance = pixels.first[view], pixels.spans[view], pixels.distance[view]
    rows, row = _rows(view, i, state), view * len(state.inside) + i
    for k in range(rows):
        line = (first[i] + k) * pixels.raster.shape[2]
        for u in range(spans[i, k, 0], spans[i, k, 1]):
            if owner[line + u] == i:
                owner[line + u] = -1
    for a in range(overlapping.start[row], overlapping.start[row + 1]):
        j = overlapping.item[a]
        lower = first[j] - first[i]
        for k in range(max(lower, 0), min(rows, lower + spans.shape[1]) if state.inside[j] else 0):
            line, below = (first[i] + k) * pixels.raster.shape[2], k - lower
            for u in range(max(spans[i, k, 0], spans[j, below, 0]), min(spans[i, k, 1], spans[j, below, 1])):
                before = owner[line + u]
                if before < 0 or distance[before] > distance[j]:
                    owner[line + u] = j


@kernel
def _pixel_gain(view: int, i: int, state: SetState) -> float:
    """Change of a view's pixel score when candidate i joins the set, for observations of weight 1."""
    pixels, owner = state.problem.pixels, state.problem.owner[view]
    first, raster, distance = pixels.first[view, i], pixels.raster[view], pixels.distance[view]
    scale, area, gained = pixels.scale[view], pixels.area[view], 0.0
    for k in range(_rows(view, i, state)):
        line = (first + k) * pixels.raster.shape[2]
        for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
            before = owner[line + u]
            if before < 0 or distance[before] > distance[i]:
                gained += raster[first + k, u] / max(area[i], scale[first + k, u])
            if before >= 0 and distance[before] > distance[i]:
                gained -= raster[first + k, u] / max(area[before], scale[first + k, u])
    return gained
