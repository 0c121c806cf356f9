"""Groups of candidates that interact, each decided by itself (HW12 section IV-B).

Two candidates interact where their projections overlap in a view with pixels, where one hides the other or both fit one
box in a view with boxes, where both may continue one track, and where they stand too close for two bodies. The score of
a set is the sum of the scores of its groups, exactly.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import BoxEvidence, DetectionProblem, PixelEvidence, RaggedArray, append, ragged_array
from stseg.detection.score.scoring import body_distance
from stseg.detection.score.set_state import SetState
from stseg.detection.score.track_state import TrackAssignment
from stseg.kernels.accelerate import kernel, part


@kernel
def fill_interactions(state: SetState, interacts: Flags) -> None:
    """Fill interacts (candidate, candidate), symmetric: whether the gain of one depends on the other."""
    followers = _followers(state.tracks)
    interacts[:] = False
    for i in range(len(interacts)):
        interacts[i, i] = True
        _mark_linked(i, state, followers, interacts[i])
        for j in range(i):
            if not interacts[i, j]:
                interacts[i, j] = interacts[j, i] = _overlap(i, j, state.problem)


@kernel
def fill_groups(state: SetState, group: Ints) -> int:
    """Fill group (candidate,) with numbers from 0, in the order of their first candidates; returns how many."""
    candidates, followers = len(group), _followers(state.tracks)
    linked, waiting, number = np.zeros(candidates, np.bool_), np.empty(candidates, np.int64), 0
    group[:] = -1
    for first in range(candidates):
        if group[first] >= 0:
            continue
        group[first], waiting[0], count = number, first, 1
        while count > 0:
            count -= 1
            i = waiting[count]
            linked[:] = False
            _mark_linked(i, state, followers, linked)
            for j in range(candidates):
                if group[j] < 0 and (linked[j] or _overlap(i, j, state.problem)):
                    group[j], waiting[count] = number, j
                    count += 1
        number += 1
    return number


@kernel
def _followers(tracks: TrackAssignment) -> RaggedArray:
    """The candidates who may continue each track."""
    followers, place = ragged_array(np.bincount(tracks.gains.item, minlength=len(tracks.member_of)))
    for i in range(len(tracks.gains.start) - 1):
        for k in range(tracks.gains.start[i], tracks.gains.start[i + 1]):
            append(followers, place, tracks.gains.item[k], i, tracks.gains.value[k])
    return followers


@part
def _mark_linked(i: int, state: SetState, followers: RaggedArray, linked: Flags) -> None:
    """Mark the candidates that share a track, a box or a line of sight with candidate i: linked (candidate,)."""
    boxes, gains = state.boxes, state.tracks.gains
    for k in range(gains.start[i], gains.start[i + 1]):
        _mark_row(gains.item[k], followers, linked)
    for view in range(boxes.views):
        row = view * len(linked) + i
        for k in range(boxes.fits.start[row], boxes.fits.start[row + 1]):
            _mark_row(view * boxes.boxes + boxes.fits.item[k], boxes.fitting, linked)
        _mark_row(row, boxes.hidden, linked)
        _mark_row(row, boxes.hiders, linked)


@part
def _mark_row(row: int, rows: RaggedArray, linked: Flags) -> None:
    for k in range(rows.start[row], rows.start[row + 1]):
        linked[rows.item[k]] = True


@part
def _overlap(i: int, j: int, problem: DetectionProblem) -> bool:
    """Whether two candidates are too close for two bodies, or their outlines share a pixel."""
    contact = problem.parameters.minimum_distance
    room = 0.5 * contact * (problem.breadth[i] + problem.breadth[j])
    if (
        abs(problem.ground[i, 0] - problem.ground[j, 0]) <= room
        and body_distance(i, j, problem.ground, problem.breadth) < contact
    ):
        return True
    return _outlines_overlap(i, j, problem.pixels)


@part
def _outlines_overlap(i: int, j: int, pixels: PixelEvidence) -> bool:
    """Whether the outlines of two candidates share a pixel."""
    for view in range(len(pixels.raster)):
        one, other = pixels.first[view, i], pixels.first[view, j]
        if one < 0 or other < 0:
            continue
        for row in range(max(one, other), min(one, other) + pixels.spans.shape[2]):
            a, b = pixels.spans[view, i, row - one], pixels.spans[view, j, row - other]
            if max(a[0], b[0]) < min(a[1], b[1]):
                return True
    return False


@kernel
def restricted(problem: DetectionProblem, group: Ints) -> DetectionProblem:
    """A problem with the boxes and tracks alone that a group (n,) may take; candidates keep their numbers."""
    boxes, parameters = problem.boxes, problem.parameters
    number = np.zeros(len(boxes.boxes), np.int64)
    match = np.empty(boxes.match.shape)  # filled, and read, for the group's boxes alone
    for view in range(len(number)):
        for b in range(boxes.boxes[view]):
            matches = boxes.match[view, :, b][group]
            if (parameters.box_log_ratio + matches > np.log(parameters.box_miss_rate)).any():
                for i in group:
                    match[view, i, number[view]] = boxes.match[view, i, b]
                number[view] += 1
    return DetectionProblem(
        BoxEvidence(match, number, boxes.hiders, boxes.inside, boxes.visible_past), problem.pixels, problem.size_prior,
        problem.birth_cost, _tracks_of(problem, group), problem.ground, problem.breadth, parameters,
        problem.assignment, problem.track_member, problem.owner, problem.view_evidence,
    )  # fmt: skip


@kernel
def _tracks_of(problem: DetectionProblem, group: Ints) -> Floats:
    """Gains of the tracks that a group may continue, float64 (candidate, k)."""
    chosen = np.zeros(problem.track_gain.shape[1], np.int64)
    count = 0
    for k in range(len(chosen)):
        if ((problem.birth_cost + problem.track_gain[:, k])[group] > 0).any():
            chosen[count] = k
            count += 1
    gains = np.zeros((len(problem.track_gain), count))
    for i in group:
        for k in range(count):
            gains[i, k] = problem.track_gain[i, chosen[k]]
    return gains
