"""What each of some candidates would add to a set, to the bit as if each set were scored by itself.

Most of a score does not change with one more member. A view with boxes whose members the candidate does not hide has
the same pairs of members and boxes as before, in the same order, with those of the candidate among them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import Problem
from stseg.detection.score.scoring import box_score, crowd, crowding, missing_box, pixel_score, track_score
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.pointed_tuples import pointed


class _BoxesOfSet(NamedTuple):
    """The members of a set in the views with boxes.

    Attributes
    ----------
    missing : float64 (view, member)
        Cost of a missing box of each member, nats.
    pairs : int64 (view,)
        Number of pairs of a member and a box that gain.
    gain : float64 (view, pair), member : int64 (view, pair), box : int64 (view, pair)
        These, in falling order of their gain.
    hides : bool (view, candidate)
        Who would hide a part of a member.
    """

    missing: Floats
    pairs: Ints
    gain: Floats
    member: Ints
    box: Ints
    hides: Flags


@kernel
def fill_additions(
    members: Ints, others: Ints, whole: Problem, totals: Floats, view_evidence: Floats, tracks: Ints
) -> None:
    """Score a set with each of some candidates as its last member.

    Parameters
    ----------
    members : int64 (n,), others : int64 (m,)
        The set, and candidates outside it.
    whole
        The problem.
    totals : float64 (m,)
        Filled with the scores, nats.
    view_evidence : float64 (m, view)
        Filled with what each view says of the candidate, nats; views with boxes first.
    tracks : int64 (m,)
        Filled with the predicted track that the candidate continues, -1 for none.
    """
    problem, count = pointed(whole), len(members)
    box_views, parameters = problem.boxes.match.shape[0], problem.parameters
    every, pressed = np.empty(count + 1, np.int64), crowding(members, count, problem)
    for a in range(count):
        every[a] = members[a]
    known = _boxes_of_set(members, problem)
    for k in range(len(others)):
        i = every[count] = others[k]
        crowded = pressed
        for a in range(count):
            crowded += crowd(i, members[a], problem)
        total = -crowded
        for a in range(count + 1):
            total += parameters.prior_log_odds + problem.size_prior[every[a]] - problem.birth_cost[every[a]]
        total += track_score(every, count + 1, problem.track_gain, problem.birth_cost, problem.assigned)
        tracks[k] = -1
        for track in range(problem.track_gain.shape[1]):
            if problem.assigned[track] == count:
                tracks[k] = track
        for view in range(box_views):
            parts = problem.view_evidence[view]
            if known.hides[view, i]:
                total += box_score(view, every, count + 1, problem.boxes, parameters, problem.assigned, parts)
            else:
                total += _score_beside(view, every, count, known, problem, parts)
        for view in range(len(problem.pixels.raster)):
            parts = problem.view_evidence[box_views + view]
            total += pixel_score(view, every, count + 1, problem.pixels, parameters, problem.assigned, parts)
        totals[k] = total
        for view in range(view_evidence.shape[1]):
            view_evidence[k, view] = problem.view_evidence[view, count]


@kernel
def _boxes_of_set(members: Ints, problem: Problem) -> _BoxesOfSet:
    """The members in all views with boxes."""
    boxes, parameters, count = problem.boxes, problem.parameters, len(members)
    views, candidates, most = boxes.match.shape
    missing, pairs, hides = np.empty((views, count)), np.zeros(views, np.int64), np.zeros((views, candidates), np.bool_)
    gain, pair = np.empty((views, count * most)), np.empty((2, views, count * most), np.int64)
    worths, taken = np.empty(count * most), np.empty((2, count * most), np.int64)
    for view in range(views):
        for a in range(count):
            i, row = members[a], view * candidates + members[a]
            missing[view, a] = missing_box(view, i, members, count, boxes, parameters)
            for b in range(boxes.boxes[view]):
                worth = parameters.box_log_ratio + boxes.match[view, i, b] - missing[view, a]
                if worth > 0:
                    worths[pairs[view]], taken[0, pairs[view]], taken[1, pairs[view]] = worth, a, b
                    pairs[view] += 1
            for k in range(boxes.hiders.start[row], boxes.hiders.start[row + 1]):
                hides[view, boxes.hiders.item[k]] = True
        order = np.argsort(-worths[: pairs[view]], kind="mergesort")
        for k in range(len(order)):
            gain[view, k] = worths[order[k]]
            pair[0, view, k], pair[1, view, k] = taken[0, order[k]], taken[1, order[k]]
    return _BoxesOfSet(missing, pairs, gain, pair[0], pair[1], hides)


@kernel
def _score_beside(view: int, every: Ints, count: int, known: _BoxesOfSet, problem: Problem, parts: Floats) -> float:
    """`box_score` of the first `count` and a last one who hides none of them; fills parts (member,)."""
    i, gain = every[count], known.gain[view]
    served, taken = np.zeros(count + 1, np.bool_), np.zeros(problem.boxes.boxes[view], np.bool_)
    for a in range(count):
        parts[a] = known.missing[view, a]
    missing = parts[count] = missing_box(view, i, every, count, problem.boxes, problem.parameters)
    k, searches = 0, True
    while searches:
        best, worth = _best_box(view, i, missing, taken, problem)
        searches = best >= 0 and not served[count]
        while k < known.pairs[view] and not (searches and (gain[k] < worth or taken[best])):
            a, b = known.member[view, k], known.box[view, k]
            if not served[a] and not taken[b]:
                served[a], taken[b] = True, True
                parts[a] += gain[k]
            k += 1
        if searches and not taken[best]:
            served[count], taken[best] = True, True
            parts[count] += worth
    return float(parts[: count + 1].sum())


@part
def _best_box(view: int, i: int, missing: float, taken: Flags, problem: Problem) -> tuple[int, float]:
    """The first of the boxes that a candidate gains most by and nobody takes, -1 for none, and that gain, nats."""
    best, most = -1, 0.0
    for b in range(len(taken)):
        worth = problem.parameters.box_log_ratio + problem.boxes.match[view, i, b] - missing
        if worth > most and not taken[b]:
            best, most = b, worth
    return best, most
