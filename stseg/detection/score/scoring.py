"""Score of a set of people: its posterior log-odds against the empty set, each piece of evidence used once.

    score(S) = sum_j [person + height_j - birth_j] + tracks(S) + sum_views sum_j part_j(S) - crowding(S)

Members that continue predicted tracks are no births: tracks(S) = sum of birth_j + gain_jk over the pairs of member j
and track k, one to one, that is greatest.
In a view with boxes, part_j is the best box that no other member takes, or the cost of a missing one, which is less
the more of j is hidden by nearer members. In a view with pixels, part_j is the mean log-odds over j's outline of the
pixels that no nearer member covers (HW12's detection energy, eqs 13 to 15, in soft form, for the labels of eq. 24); in
the image of a body that explains more, over as many pixels as that one explains (`blob_scale`).

crowding(S) is the repulsion of bodies, the pair potential of a Gibbs point process (Moeller and Waagepetersen 2003,
section 6.2): places of people are a Poisson process with its density multiplied by exp(-phi(d)) for each pair at a
distance d. Soft bodies may press together, so phi rises linearly from the distance at which they touch,
`minimum_distance`. Where views show pixels there is a hard core besides, within which no two bodies stand: the strip
that a wide body leaves unexplained at its sides shows in all views alike, and any finite cost is outvoted by enough of
them. A box is evidence for one person only, and places from boxes are no better known than the core is wide, so boxes
have no core. Wider bodies touch earlier, so d is the distance over the mean of their widths relative to a common one (a
process of marked points). Narrow ones get no nearer for it: the remains of a silhouette are slim, too.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.detection.problem import BoxEvidence, DetectionProblem, PixelEvidence, ScoreParameters
from stseg.kernels.accelerate import kernel, part
from stseg.kernels.linear_assignment import fill_assignment_of_least_cost
from stseg.kernels.pointed_tuples import pointed

CORE_MARGIN = 0.05
"""The hard core ends this far below the distance at which bodies touch, metres: at 0.25 m, a body's depth."""
_CONTACT_COST = 2.0
"""Cost of a pair that just touches, nats."""
_COINCIDENCE_COST = 20.0
"""Further cost of two soft bodies in one place, nats."""
_CORE_COST = 1e4
"""Cost of a pair within the hard core, nats: more than the evidence of all views for a person."""
_ROUNDING_RATIO = 1.0 + 1e-9
"""Ratio of two distances above which rounding errors do not matter."""


@kernel
def set_score(members: Ints, count: int, problem: DetectionProblem) -> float:
    """Score of the first `count` members, nats; fills the problem's `view_evidence` and `track_member`."""
    total = -crowding(members, count, problem)
    for a in range(count):
        total += problem.parameters.prior_log_odds + problem.size_prior[members[a]] - problem.birth_cost[members[a]]
    total += track_score(members, count, problem.track_gain, problem.birth_cost, problem.track_member)
    box_views = problem.boxes.match.shape[0]
    for view in range(box_views):
        parts = problem.view_evidence[view]
        total += box_score(view, members, count, problem.boxes, problem.parameters, problem.assignment, parts)
    for view in range(problem.pixels.raster.shape[0]):
        parts = problem.view_evidence[box_views + view]
        total += pixel_score(view, members, count, problem.pixels, problem.parameters, problem.assignment, parts)
    return total


@kernel
def fill_set_score(members: Ints, whole: DetectionProblem, view_evidence: Floats, tracks: Ints) -> float:
    """Score of a set of candidates, int64 (member,), nats.

    Filled are `view_evidence` float64 (view, member) with the evidence of each view for each member, nats, views with
    boxes first; and `tracks` int64 (member,) with the predicted track that each member continues, -1 for none.
    """
    problem, count = pointed(whole), len(members)
    total = set_score(members, count, problem)
    for view in range(len(view_evidence)):
        for a in range(count):
            view_evidence[view, a] = problem.view_evidence[view, a]
    tracks[:] = -1
    for track in range(problem.track_gain.shape[1]):
        if problem.track_member[track] >= 0:
            tracks[problem.track_member[track]] = track
    return total


@kernel
def track_score(members: Ints, count: int, gain: Floats, birth_cost: Floats, member_of: Ints) -> float:
    """Assign tracks to members, one to one, at the greatest sum; fills member_of (track,) with places in `members`.

    Tracks without a member get -1. A greedy assignment swaps people who pass each other more often.
    """
    tracks = gain.shape[1]
    member_of[:tracks] = -1
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
            member_of[k] = a
            total -= cost[a, k]
    return total


@kernel
def crowding(members: Ints, count: int, problem: DetectionProblem) -> float:
    """Cost of all pairs of bodies, nats."""
    total = 0.0
    for a in range(count):
        for b in range(a):
            total += pair_cost(members[a], members[b], problem)
    return total


@part
def contact_limit(problem: DetectionProblem) -> float:
    """A distance beyond which no pair costs anything, metres."""
    widest = 0.0
    for i in range(len(problem.breadth)):
        widest = max(widest, problem.breadth[i])
    return float(_ROUNDING_RATIO * problem.parameters.minimum_distance * widest)


@part
def pair_cost(i: int, j: int, problem: DetectionProblem) -> float:
    """Cost of one pair, nats."""
    parameters = problem.parameters
    contact = 0.5 * _ROUNDING_RATIO * parameters.minimum_distance * (problem.breadth[i] + problem.breadth[j])
    if abs(problem.ground[i, 0] - problem.ground[j, 0]) > contact:  # most pairs are decided here
        return 0.0
    distance = body_distance(i, j, problem.ground, problem.breadth)
    if distance >= parameters.minimum_distance:
        return 0.0
    if distance < parameters.hard_core:
        return _CORE_COST
    return float(_CONTACT_COST + _COINCIDENCE_COST * (1.0 - distance / parameters.minimum_distance))


@part
def body_distance(i: int, j: int, ground: Floats, breadth: Floats) -> float:
    """Distance of two bodies on the ground float64 (n, 2), as of bodies of common width: metres."""
    distance = np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1])
    return float(2.0 * distance / (breadth[i] + breadth[j]))


@kernel
def box_score(
    view: int, members: Ints, count: int, boxes: BoxEvidence, parameters: ScoreParameters, member_of: Ints,
    parts: Floats,
) -> float:  # fmt: skip
    """One view of boxes; fills parts (member,) and member_of (box,) with the place in `members`, -1 for none.

    Boxes are assigned greedily, in falling order of their gain, one to one.
    """
    number = boxes.boxes[view]
    gain, pair, pairs = np.empty(count * number), np.empty((count * number, 2), np.int64), 0
    for a in range(count):
        i = members[a]
        parts[a] = missing_box_cost(_visible_share(view, i, members, count, boxes), parameters)
        for b in range(number):
            box_gain = parameters.box_log_ratio + boxes.match[view, i, b] - parts[a]
            if box_gain > 0:
                gain[pairs], pair[pairs, 0], pair[pairs, 1] = box_gain, a, b
                pairs += 1
    member_of[:number] = -1
    has_box = np.zeros(count, np.bool_)
    for k in np.argsort(-gain[:pairs], kind="mergesort"):
        a, b = pair[k]
        if not has_box[a] and member_of[b] < 0:
            has_box[a], member_of[b] = True, a
            parts[a] += gain[k]
    return float(parts[:count].sum())


@part
def _visible_share(view: int, i: int, members: Ints, count: int, boxes: BoxEvidence) -> float:
    """Share of candidate i's box in the image and not behind a member's, 0..1."""
    visible, hiders, visible_past = boxes.inside[view, i], boxes.hiders, boxes.visible_past
    row = view * boxes.inside.shape[1] + i
    for k in range(hiders.start[row], hiders.start[row + 1]):
        visible_past[hiders.item[k]] = hiders.value[k]
    for b in range(count):
        visible *= visible_past[members[b]]
    for k in range(hiders.start[row], hiders.start[row + 1]):
        visible_past[hiders.item[k]] = 1.0
    return float(visible)


@part
def missing_box_cost(visible: float, parameters: ScoreParameters) -> float:
    """Cost of a missing box of a body of which such a share is visible, nats."""
    share = (visible - parameters.hidden_visibility) / (parameters.full_visibility - parameters.hidden_visibility)
    return float(
        np.log(1.0 - (1.0 - parameters.box_miss_rate) * min(max(share, parameters.hidden_detection_rate), 1.0))
    )


@kernel
def fill_box_assignment(members: Ints, whole: DetectionProblem, boxes: Ints) -> None:
    """Fill boxes int64 (view, box) with the places in members, int64 (n,), that boxes are assigned to, -1 for none."""
    problem = pointed(whole)
    boxes[:] = -1
    for view in range(len(boxes)):
        parts = problem.view_evidence[0]
        box_score(view, members, len(members), problem.boxes, problem.parameters, boxes[view], parts)


@kernel
def pixel_score(
    view: int, members: Ints, count: int, pixels: PixelEvidence, parameters: ScoreParameters, owner: Ints,
    parts: Floats,
) -> float:  # fmt: skip
    """One view of pixels; fills parts (member,) and owner (v * u,) inside outlines with the place in `members`."""
    raster, scale = pixels.raster[view], pixels.scale[view]
    rows, columns = raster.shape
    for a in range(count):
        first = pixels.first[view, members[a]]
        for k in range(min(pixels.spans.shape[2], rows - first) if first >= 0 else 0):
            line = (first + k) * columns
            owner[line + pixels.spans[view, members[a], k, 0] : line + pixels.spans[view, members[a], k, 1]] = -1
    order = np.argsort(pixels.distance[view][members[:count]], kind="mergesort")
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
