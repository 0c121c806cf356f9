"""Scores of sets of candidates, and what each is assigned, for all that is not a kernel (`scoring`)."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints, Shorts
from stseg.detection.problem import PixelEvidence, Problem
from stseg.detection.score.scoring import box_score, set_score, track_score
from stseg.kernels.accelerate import kernel
from stseg.kernels.pointed_tuples import pointed


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
def fill_assignments(members: Ints, whole: Problem, shapes: Ints, boxes: Ints, owners: Shorts) -> None:
    """Assign the evidence of all views to the members, int64 (n,), by their places in `members`, -1 for none.

    Parameters
    ----------
    shapes : int64 (view, 2)
        Rows and columns of the views that deliver pixels.
    boxes : int64 (view, box)
        Filled for the views that deliver boxes.
    owners : int16 (pixel,)
        Filled for the pixels of these views, one view after the other.
    """
    problem, count = pointed(whole), len(members)
    boxes[:] = -1
    for view in range(len(boxes)):
        box_score(view, members, count, problem.boxes, problem.parameters, boxes[view], problem.view_evidence[0])
    owners[:] = -1
    start = 0
    for view in range(len(shapes)):
        rows, columns = shapes[view]
        _fill_owners(view, members, problem.pixels, columns, owners[start : start + rows * columns])
        start += rows * columns


@kernel
def _fill_owners(view: int, members: Ints, pixels: PixelEvidence, columns: int, owners: Shorts) -> None:
    """Assign the pixels of a view (v * u,) that has so many columns to the nearest member whose outline covers them."""
    rows = len(owners) // columns
    for a in np.argsort(pixels.order[view][members], kind="mergesort"):
        first, spans = pixels.first[view, members[a]], pixels.spans[view, members[a]]
        for k in range(min(len(spans), rows - first) if first >= 0 else 0):
            line = (first + k) * columns
            for u in range(spans[k, 0], spans[k, 1]):
                if owners[line + u] < 0:
                    owners[line + u] = a
