"""Scores of sets of candidates, and what each is assigned, for all that is not a kernel (`stseg.detection.scoring`)."""

from __future__ import annotations

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints
from stseg.detection.problem import Problem
from stseg.detection.scoring import box_score, pixel_score, set_score, track_score
from stseg.pointed_tuples import pointed


@kernel
def fill_set_scores(sets: Ints, whole: Problem, totals: Floats, view_evidence: Floats, tracks: Ints) -> None:
    """Score some sets of as many candidates each.

    Parameters
    ----------
    sets : int64 (set, member)
        Candidates.
    whole
        The problem.
    totals : float64 (set,)
        Filled with the scores, nats.
    view_evidence : float64 (set, view, member)
        Filled with what each view says of each member, nats; views with boxes first.
    tracks : int64 (set, member)
        Filled with the predicted track that each member continues, -1 for none.
    """
    problem, count = pointed(whole), sets.shape[1]
    for s in range(len(sets)):
        totals[s] = set_score(sets[s], count, problem)
        for view in range(view_evidence.shape[1]):
            for a in range(count):
                view_evidence[s, view, a] = problem.view_evidence[view, a]
        track_score(sets[s], count, problem.track_gain, problem.birth_cost, problem.assigned)
        tracks[s] = -1
        for track in range(problem.track_gain.shape[1]):
            if problem.assigned[track] >= 0:
                tracks[s, problem.assigned[track]] = track


@kernel
def fill_assignments(members: Ints, whole: Problem, boxes: Ints, pixels: Ints) -> None:
    """Assign the evidence of all views to the members, int64 (n,).

    Fills boxes (view, box) and pixels (view, v * u), of views that have such, with places in `members`, -1 for none.
    """
    problem, count = pointed(whole), len(members)
    parts = problem.view_evidence[0]
    boxes[:] = -1
    pixels[:] = -1
    for view in range(len(boxes)):
        box_score(view, members, count, problem.boxes, problem.parameters, boxes[view], parts)
    for view in range(len(pixels)):
        pixel_score(view, members, count, problem.pixels, problem.parameters, pixels[view], parts)
