"""Groups of candidates that interact, each decided by itself (HW12 section IV-B).

Two candidates interact where their projections overlap in a view with pixels, where one hides the other or both fit one
box in a view with boxes, where both may continue one track, and where they stand too close for two bodies. The score of
a set is the sum of the scores of its groups, exactly.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import BoxEvidence, DetectionProblem, RaggedArray
from stseg.detection.score.set_state import SetState
from stseg.kernels.accelerate import kernel, part


@kernel
def fill_groups(state: SetState, group: Ints) -> int:
    """Fill group (candidate,) with numbers from 0, in the order of their first candidates; returns how many."""
    candidates = len(group)
    linked, waiting, number = np.empty(candidates, np.bool_), np.empty(candidates, np.int64), 0
    group[:] = -1
    for first in range(candidates):
        if group[first] >= 0:
            continue
        group[first], waiting[0], count = number, first, 1
        while count > 0:
            count -= 1
            mark_interacting(waiting[count], state, linked)
            for j in range(candidates):
                if group[j] < 0 and linked[j]:
                    group[j], waiting[count] = number, j
                    count += 1
        number += 1
    return number


@kernel
def mark_interacting(i: int, state: SetState, linked: Flags) -> None:
    """Fill linked (candidate,): whether the gain of candidate i depends on each; on itself, too."""
    boxes, tracks, neighbours, candidates = state.boxes, state.tracks, state.neighbours, len(linked)
    for j in range(candidates):
        linked[j] = j == i
    for k in range(neighbours.start[i], neighbours.start[i + 1]):
        if neighbours.value[k] > 0:
            linked[neighbours.item[k]] = True
    for row in range(i, len(state.overlapping.start) - 1, candidates):
        _mark_row(row, state.overlapping, linked)
    for k in range(tracks.gains.start[i], tracks.gains.start[i + 1]):
        _mark_row(tracks.gains.item[k], tracks.followers, linked)
    for view in range(boxes.views):
        row = view * candidates + i
        for k in range(boxes.fits.start[row], boxes.fits.start[row + 1]):
            _mark_row(view * boxes.boxes + boxes.fits.item[k], boxes.fitting, linked)
        _mark_row(row, boxes.hidden, linked)
        _mark_row(row, boxes.hiders, linked)


@part
def _mark_row(row: int, rows: RaggedArray, linked: Flags) -> None:
    for k in range(rows.start[row], rows.start[row + 1]):
        linked[rows.item[k]] = True


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
