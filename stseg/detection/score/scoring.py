"""Score of a set of people: its posterior log-odds against the empty set, each piece of evidence used once.

    score(S) = sum_j [person + height_j - birth_j] + tracks(S) + sum_views sum_j part_j(S) - crowding(S)

Members that continue predicted tracks are no births: tracks(S) = sum of birth_j + gain_jk over the pairs of member j
and track k, one to one, that is greatest.
In a view with boxes, part_j is the best box that no other member takes, or the cost of a missing one, which is less
the more of j is hidden by nearer members. In a view with pixels, part_j is the mean log-odds over j's outline of the
pixels that no nearer member covers (HW12's detection energy, eqs 13 to 15, in soft form, for the labels of eq. 24); in
the image of a body that explains more, over as many pixels as that one explains (`blob_scale`).
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.problem import BoxEvidence, Parameters, PixelEvidence, Problem
from stseg.detection.score.repulsion import apart_of_bodies, pair_cost
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.linear_assignment import fill_assignment_of_least_cost

_CLEARLY = 1.0 + 1e-9
"""Ratio of two distances above which rounding errors do not matter."""


@kernel
def set_score(members: Ints, count: int, problem: Problem) -> float:
    """Score of the first `count` members, nats; fills `problem.view_evidence`, views with boxes first."""
    total = -crowding(members, count, problem)
    for a in range(count):
        total += problem.parameters.prior_log_odds + problem.size_prior[members[a]] - problem.birth_cost[members[a]]
    total += track_score(members, count, problem.track_gain, problem.birth_cost, problem.assigned)
    box_views = problem.boxes.match.shape[0]
    for view in range(box_views):
        total += box_score(
            view, members, count, problem.boxes, problem.parameters, problem.assigned, problem.view_evidence[view]
        )
    for view in range(problem.pixels.raster.shape[0]):
        parts = problem.view_evidence[box_views + view]
        total += pixel_score(view, members, count, problem.pixels, problem.parameters, problem.assigned, parts)
    return total


@kernel
def track_score(members: Ints, count: int, gain: Floats, birth_cost: Floats, taken_by: Ints) -> float:
    """Assign tracks to members, one to one, at the greatest sum; fills taken_by (track,) with places in `members`.

    Tracks without a member get -1. A greedy assignment swaps people who pass each other more often.
    """
    tracks = gain.shape[1]
    taken_by[:tracks] = -1
    if tracks == 0:
        return 0.0
    cost = np.zeros((count, max(tracks, count)))
    for a in range(count):
        for k in range(tracks):
            cost[a, k] = -max(birth_cost[members[a]] + gain[members[a], k], 0.0)
    column_of = np.zeros(count, np.int64)
    fill_assignment_of_least_cost(cost, column_of)
    total = 0.0
    for a in range(count):
        k = column_of[a]
        if cost[a, k] < 0:
            taken_by[k] = a
            total -= cost[a, k]
    return total


@kernel
def crowding(members: Ints, count: int, problem: Problem) -> float:
    """Cost of all pairs of bodies, nats; see `stseg.detection.score.repulsion`."""
    total = 0.0
    for a in range(count):
        for b in range(a):
            total += crowd(members[a], members[b], problem)
    return total


@part
def crowd(i: int, j: int, problem: Problem) -> float:
    """Cost of one pair, nats."""
    room = 0.5 * _CLEARLY * problem.parameters.minimum_distance * (problem.breadth[i] + problem.breadth[j])
    if abs(problem.ground[i, 0] - problem.ground[j, 0]) > room:  # most pairs are decided here
        return 0.0
    distance = apart_of_bodies(i, j, problem.ground, problem.breadth)
    return float(pair_cost(distance, problem.parameters.minimum_distance, problem.parameters.hard_core))


@kernel
def box_score(
    view: int, members: Ints, count: int, boxes: BoxEvidence, parameters: Parameters, taken_by: Ints, parts: Floats
) -> float:
    """One view of boxes; fills parts (member,) and taken_by (box,) with the place in `members`, -1 for none.

    Boxes are assigned greedily, in falling order of their gain, one to one.
    """
    number = boxes.boxes[view]
    gain, pair, found = np.empty(count * number), np.empty((count * number, 2), np.int64), 0
    for a in range(count):
        i = members[a]
        parts[a] = missing_box(view, i, members, count, boxes, parameters)
        for b in range(number):
            worth = parameters.box_log_ratio + boxes.match[view, i, b] - parts[a]
            if worth > 0:
                gain[found], pair[found, 0], pair[found, 1] = worth, a, b
                found += 1
    taken_by[:number] = -1
    served = np.zeros(count, np.bool_)
    for k in np.argsort(-gain[:found], kind="mergesort"):
        a, b = pair[k]
        if not served[a] and taken_by[b] < 0:
            served[a], taken_by[b] = True, a
            parts[a] += gain[k]
    return float(parts[:count].sum())


@part
def missing_box(
    view: int, i: int, members: Ints, count: int, boxes: BoxEvidence, parameters: Parameters
) -> float:  # fmt: skip
    """Cost of a missing box of candidate i, of whom members may hide a part, nats."""
    return missing_by_share(_visible(view, i, members, count, boxes), parameters)


@part
def _visible(view: int, i: int, members: Ints, count: int, boxes: BoxEvidence) -> float:
    """Share of candidate i's box in the image and not behind a member's, 0..1."""
    visible, hiders, left = boxes.inside[view, i], boxes.hiders, boxes.left
    row = view * boxes.inside.shape[1] + i
    for k in range(hiders.start[row], hiders.start[row + 1]):
        left[hiders.item[k]] = hiders.value[k]
    for b in range(count):
        visible *= left[members[b]]
    for k in range(hiders.start[row], hiders.start[row + 1]):
        left[hiders.item[k]] = 1.0
    return float(visible)


@part
def missing_by_share(visible: float, parameters: Parameters) -> float:
    """Cost of a missing box of a body of which such a share is visible, nats."""
    share = (visible - parameters.hidden_visibility) / (parameters.full_visibility - parameters.hidden_visibility)
    return float(
        np.log(1.0 - (1.0 - parameters.box_miss_rate) * min(max(share, parameters.hidden_detection_rate), 1.0))
    )


@kernel
def pixel_score(
    view: int, members: Ints, count: int, pixels: PixelEvidence, parameters: Parameters, owner: Ints, parts: Floats
) -> float:
    """One view of pixels; fills parts (member,) and owner (v * u,) inside outlines with the place in `members`."""
    raster, scale = pixels.raster[view], pixels.scale[view]
    rows, columns = raster.shape
    for a in range(count):
        first = pixels.first[view, members[a]]
        for k in range(min(pixels.spans.shape[2], rows - first) if first >= 0 else 0):
            line = (first + k) * columns
            owner[line + pixels.spans[view, members[a], k, 0] : line + pixels.spans[view, members[a], k, 1]] = -1
    order = np.argsort(pixels.order[view][members[:count]], kind="mergesort")
    for a in order:
        parts[a] = 0.0
        i = members[a]
        first = pixels.first[view, i]
        if first < 0:
            continue
        total, area = 0.0, pixels.area[view, i]
        for k in range(min(pixels.spans.shape[2], rows - first)):
            line = (first + k) * columns
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                if owner[line + u] < 0:
                    owner[line + u] = a
                    total += raster[first + k, u] / max(area, scale[first + k, u])
        parts[a] = parameters.effective_observations * total
    return float(parts[:count].sum())
