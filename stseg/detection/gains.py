"""Gain of one more person, without scoring the set anew.

Pixels are the dear part of a score, and one more person changes their assignment only inside the person's outline: with
the set's assignment at hand, the gain is a sum over that outline alone.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel, part
from stseg.arrays import Floats, Ints
from stseg.detection.problem import Parameters, PixelAssignment, PixelEvidence, Problem
from stseg.detection.scoring import box_score, crowd, missing_box, track_score


@kernel
def fill_assignment(members: Ints, count: int, pixels: PixelEvidence, assigned: PixelAssignment) -> None:
    """Fill owners (view, v * u), -1 everywhere before, with the member whom each pixel is assigned to."""
    for a in range(count):
        insert(members[a], pixels, assigned)


@kernel
def clear_assignment(members: Ints, count: int, pixels: PixelEvidence, assigned: PixelAssignment) -> None:
    """Make a set's assignment -1 everywhere again."""
    for a in range(count):
        for view in range(len(pixels.raster)):
            first = pixels.first[view, members[a]]
            for k in range(_rows(first, pixels)):
                line = (first + k) * pixels.raster.shape[2]
                for u in range(pixels.spans[view, members[a], k, 0], pixels.spans[view, members[a], k, 1]):
                    assigned[view, line + u] = -1


@kernel
def insert(i: int, pixels: PixelEvidence, assigned: PixelAssignment) -> None:
    """Assign to candidate i all pixels that no nearer member covers."""
    for view in range(len(pixels.raster)):
        first, away = pixels.first[view, i], pixels.order[view]
        for k in range(_rows(first, pixels)):
            line = (first + k) * pixels.raster.shape[2]
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = assigned[view, line + u]
                if before < 0 or away[before] > away[i]:
                    assigned[view, line + u] = i


@kernel
def withdraw(i: int, members: Ints, count: int, pixels: PixelEvidence, assigned: PixelAssignment) -> None:
    """Reassign candidate i's pixels to the nearest of the first `count` members that covers each."""
    for view in range(len(pixels.raster)):
        first, spans, away = pixels.first[view], pixels.spans[view], pixels.order[view]
        rows = _rows(first[i], pixels)
        for k in range(rows):
            line = (first[i] + k) * pixels.raster.shape[2]
            for u in range(spans[i, k, 0], spans[i, k, 1]):
                if assigned[view, line + u] == i:
                    assigned[view, line + u] = -1
        for a in range(count):
            j = members[a]
            lower = first[j] - first[i]
            for k in range(max(lower, 0), min(rows, lower + spans.shape[1]) if first[j] >= 0 else 0):
                line, below = (first[i] + k) * pixels.raster.shape[2], k - lower
                for u in range(max(spans[i, k, 0], spans[j, below, 0]), min(spans[i, k, 1], spans[j, below, 1])):
                    before = assigned[view, line + u]
                    if before < 0 or away[before] > away[j]:
                        assigned[view, line + u] = j


@part
def _rows(first: int, pixels: PixelEvidence) -> int:
    """Rows of an outline that begins at row `first` that may lie on the raster."""
    return min(pixels.spans.shape[2], pixels.raster.shape[1] - first) if first >= 0 else 0


@kernel
def box_scores(members: Ints, count: int, problem: Problem) -> Floats:
    """Score of each view with boxes, nats, float64 (view,): boxes are assigned anew whenever the set changes."""
    scores = np.empty(len(problem.boxes.boxes))
    for view in range(len(scores)):
        scores[view] = box_score(
            view, members, count, problem.boxes, problem.parameters, problem.assigned, problem.view_evidence[view]
        )
    return scores


@kernel
def gain_of(i: int, members: Ints, count: int, scores: Floats, assigned: PixelAssignment, problem: Problem) -> float:
    """Gain of candidate i, nats.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        The first `count` are the set; the next place is scratch.
    scores
        The set's `box_scores`.
    assigned
        The set's, from `fill_assignment`.
    """
    gain = unpaired_gain(i, members, count, assigned, problem) + _track_gain(i, members, count, problem)
    members[count] = i
    for view in range(len(scores)):
        if _shares_no_box(view, i, members, count, problem):
            gain += missing_box(view, i, members, count, problem.boxes, problem.parameters)
        else:
            parts = problem.view_evidence[view]
            gain -= scores[view]
            gain += box_score(
                view, members, count + 1, problem.boxes, problem.parameters, problem.assigned, parts
            )  # fmt: skip
    return gain


@kernel
def loss_of(i: int, members: Ints, count: int, scores: Floats, assigned: PixelAssignment, problem: Problem) -> float:
    """What a set loses without its member i, nats.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        The first `count` are the other members.
    scores
        The `box_scores` of the set with i.
    assigned
        That of the set without i.
    """
    loss = unpaired_gain(i, members, count, assigned, problem) + _track_gain(i, members, count, problem)
    for view in range(len(scores)):
        if _shares_no_box(view, i, members, count, problem):
            loss += missing_box(view, i, members, count, problem.boxes, problem.parameters)
        else:
            parts = problem.view_evidence[view]
            loss += scores[view]
            loss -= box_score(view, members, count, problem.boxes, problem.parameters, problem.assigned, parts)
    return loss


@kernel
def _shares_no_box(view: int, i: int, members: Ints, count: int, problem: Problem) -> bool:
    """Whether candidate i fits no box of a view, and hides no member there: then the others' parts stay the same."""
    boxes, parameters = problem.boxes, problem.parameters
    for a in range(count):
        if boxes.cover[view, members[a], i] > 0.0:
            return False
    missing = missing_box(view, i, members, count, boxes, parameters)
    best = -np.inf
    for b in range(boxes.boxes[view]):
        best = max(best, boxes.match[view, i, b])
    return bool(parameters.box_log_ratio + best - missing <= 0.0)


@kernel
def _track_gain(i: int, members: Ints, count: int, problem: Problem) -> float:
    """Gain of candidate i from the assignment of tracks, nats.

    It changes among the members alone that are linked with i by tracks that two of them may continue.
    """
    tracks = problem.track_gain.shape[1]
    linked, taken, reached = np.empty(count + 1, np.int64), np.zeros(count, np.bool_), np.zeros(tracks, np.bool_)
    linked[0] = i
    number, next_one = 1, 0
    while next_one < number:
        one = linked[next_one]
        next_one += 1
        for k in range(tracks):
            if reached[k] or problem.birth_cost[one] + problem.track_gain[one, k] <= 0.0:
                continue
            reached[k] = True
            for a in range(count):
                j = members[a]
                if not taken[a] and problem.birth_cost[j] + problem.track_gain[j, k] > 0.0:
                    taken[a] = True
                    linked[number] = j
                    number += 1
    gain = track_score(linked, number, problem.track_gain, problem.birth_cost, problem.assigned)
    return gain - track_score(linked[1:], number - 1, problem.track_gain, problem.birth_cost, problem.assigned)


@kernel
def unpaired_gain(i: int, members: Ints, count: int, assigned: PixelAssignment, problem: Problem) -> float:
    """The part of that gain that needs no matching: prior, crowding and pixels."""
    gain = problem.parameters.prior_log_odds + problem.size_prior[i] - problem.birth_cost[i]
    for a in range(count):
        gain -= crowd(i, members[a], problem)
    return float(gain + _pixel_gain(i, problem.pixels, problem.parameters, assigned))


@kernel
def _pixel_gain(i: int, pixels: PixelEvidence, parameters: Parameters, assigned: PixelAssignment) -> float:
    columns = pixels.raster.shape[2]
    total = 0.0
    for view in range(len(pixels.raster)):
        first, raster, away = pixels.first[view, i], pixels.raster[view], pixels.order[view]
        scale, area = pixels.scale[view], pixels.area[view]
        if first < 0:
            continue
        gained = 0.0
        for k in range(_rows(first, pixels)):
            line = (first + k) * columns
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = assigned[view, line + u]
                if before < 0 or away[before] > away[i]:
                    gained += raster[first + k, u] / max(area[i], scale[first + k, u])
                if before >= 0 and away[before] > away[i]:
                    gained -= raster[first + k, u] / max(area[before], scale[first + k, u])
        total += gained
    return float(parameters.effective_observations * total)
