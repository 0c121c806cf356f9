"""How well a set of people explains a frame: log-odds against nobody at all, each piece of evidence used once.

    score(S) = sum_j [person + height_j - newcomer_j] + walkers(S) + sum_views sum_j part_j(S) - crowding(S)

Members whom the frames before led to expect are no newcomers: walkers(S) = sum of newcomer_j + known_jk over the pairs
of member j and walker k, one to one.
In a view with boxes, part_j is the best box that nobody else in S takes, or the cost of a missing one, which is less
the more of j is hidden by nearer members. In a view with pixels, part_j is the mean log-odds over j's outline of the
pixels that no nearer member covers (HW12's detection energy, eqs 13 to 15, in soft form, for the labels of eq. 24).
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints
from stseg.detection.problem import BoxEvidence, Parameters, PixelEvidence, Problem

_CROWDED = 20.0


@kernel
def set_score(members: Ints, count: int, case: Problem) -> float:
    """Score of the first `count` members, nats; fills `case.parts` (view, member), boxes' views first, then pixels'."""
    total = -crowding(members, count, case.ground, case.terms.apart)
    for a in range(count):
        total += case.terms.person + case.own[members[a]] - case.newcomer[members[a]]
    total += walker_score(members, count, case.known, case.newcomer, case.owner)
    box_views = case.boxes.match.shape[0]
    for view in range(box_views):
        total += box_score(view, members, count, case.boxes, case.terms, case.owner, case.parts[view])
    for view in range(case.pixels.raster.shape[0]):
        parts = case.parts[box_views + view]
        total += pixel_score(view, members, count, case.pixels, case.terms, case.owner, parts)
    return total


@kernel
def walker_score(members: Ints, count: int, known: Floats, newcomer: Floats, taken_by: Ints) -> float:
    """Walkers go to members in falling order of what they gain; fills taken_by (walker,) with the place in `members`.

    -1 is for a walker who is nobody of the set.
    """
    walkers = known.shape[1]
    taken_by[:walkers] = -1
    served = np.zeros(count, np.bool_)
    total = 0.0
    while True:
        best, best_a, best_k = 0.0, -1, -1
        for a in range(count):
            if not served[a]:
                for k in range(walkers):
                    gain = newcomer[members[a]] + known[members[a], k]
                    if gain > best and taken_by[k] < 0:
                        best, best_a, best_k = gain, a, k
        if best_a < 0:
            break
        served[best_a], taken_by[best_k] = True, best_a
        total += best
    return total


@kernel
def crowding(members: Ints, count: int, ground: Floats, apart: float) -> float:
    """What it costs that bodies cannot stand inside each other, nats."""
    total = 0.0
    for a in range(count):
        for b in range(a):
            total += crowd(members[a], members[b], ground, apart)
    return total


@kernel
def crowd(i: int, j: int, ground: Floats, apart: float) -> float:
    """What two of them cost, nats."""
    distance = np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1])
    return float(2.0 + _CROWDED * (1.0 - distance / apart)) if distance < apart else 0.0


@kernel
def box_score(
    view: int, members: Ints, count: int, boxes: BoxEvidence, terms: Parameters, taken_by: Ints, parts: Floats
) -> float:
    """One view of boxes; fills parts (member,) and taken_by (box,) with the place in `members`, -1 for nobody.

    Boxes go to members in falling order of what they gain, one to one.
    """
    number = boxes.boxes[view]
    gain, pair, found = np.empty(count * number), np.empty((count * number, 2), np.int64), 0
    for a in range(count):
        i = members[a]
        parts[a] = _missing(_visible(view, i, members, count, boxes), terms)
        for b in range(number):
            worth = terms.hit + boxes.match[view, i, b] - parts[a]
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


@kernel
def _visible(view: int, i: int, members: Ints, count: int, boxes: BoxEvidence) -> float:
    """How much of candidate i's box is in the image and not behind a member's, 0..1."""
    visible = boxes.inside[view, i]
    for b in range(count):
        visible *= 1.0 - boxes.cover[view, i, members[b]]
    return float(visible)


@kernel
def _missing(visible: float, terms: Parameters) -> float:
    """What it costs that there is no box of somebody of whom so much is visible, nats."""
    share = (visible - terms.hidden_below) / (terms.whole_above - terms.hidden_below)
    return float(np.log(1.0 - (1.0 - terms.box_miss) * min(max(share, terms.least), 1.0)))


@kernel
def pixel_score(
    view: int, members: Ints, count: int, pixels: PixelEvidence, terms: Parameters, owner: Ints, parts: Floats
) -> float:
    """One view of pixels; fills parts (member,) and owner (v * u,) inside outlines with the place in `members`."""
    raster = pixels.raster[view]
    rows, columns = raster.shape
    for a in range(count):
        first = pixels.first[view, members[a]]
        for k in range(min(pixels.spans.shape[2], rows - first) if first >= 0 else 0):
            line = (first + k) * columns
            owner[line + pixels.spans[view, members[a], k, 0] : line + pixels.spans[view, members[a], k, 1]] = -1
    order = np.argsort(pixels.order[view][members[:count]])
    for a in order:
        parts[a] = 0.0
        i = members[a]
        first = pixels.first[view, i]
        if first < 0:
            continue
        total = 0.0
        for k in range(min(pixels.spans.shape[2], rows - first)):
            line = (first + k) * columns
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                if owner[line + u] < 0:
                    owner[line + u] = a
                    total += raster[first + k, u]
        parts[a] = terms.body_weight * total / pixels.area[view, i]
    return float(parts[:count].sum())
