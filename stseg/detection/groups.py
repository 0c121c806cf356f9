"""Candidates whose evidence touches, and the groups that this makes, which can be decided apart (HW12 section IV-B).

Two candidates touch where their projections overlap in a view with pixels, where one hides the other or both fit one
box in a view with boxes, where both may be one walker, and where they stand too near for two bodies. The score of a set
is the sum of the scores of its groups, exactly.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import BoxEvidence, PixelEvidence, Problem


@kernel
def fill_touch(case: Problem, touch: Flags) -> None:
    """Fill touch (candidate, candidate), symmetric: whether one of the two bears on what the other adds to a set."""
    boxes, pixels, known = case.boxes, case.pixels, case.known
    touch[:] = False
    for k in range(known.shape[1]):
        _touch_each_other(np.flatnonzero(case.newcomer + known[:, k] > 0), touch)
    for view in range(len(boxes.boxes)):
        for b in range(boxes.boxes[view]):
            _touch_each_other(np.flatnonzero(_fits(boxes.match[view, :, b], case)), touch)
    for i in range(len(touch)):
        touch[i, i] = True
        for j in range(i):
            if not touch[i, j]:
                touch[i, j] = touch[j, i] = _hides(i, j, case) or _too_near(i, j, case) or _overlap(i, j, pixels)


@kernel
def _fits(match: Floats, case: Problem) -> Flags:
    """Who may be better off with a box than without, from their matches (n,): bool (n,)."""
    return np.asarray(case.terms.hit + match > np.log(case.terms.box_miss))


@kernel
def _touch_each_other(marked: Ints, touch: Flags) -> None:
    for i in marked:
        for j in marked:
            touch[i, j] = True


@kernel
def _hides(i: int, j: int, case: Problem) -> bool:
    """Whether one of them hides the other in a view with boxes."""
    cover = case.boxes.cover
    hidden = 0.0
    for view in range(len(cover)):
        hidden += cover[view, i, j] + cover[view, j, i]
    return hidden > 0


@kernel
def _too_near(i: int, j: int, case: Problem) -> bool:
    ground = case.ground
    return bool(np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1]) < case.terms.apart)


@kernel
def _overlap(i: int, j: int, pixels: PixelEvidence) -> bool:
    """Whether they share a pixel."""
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
def fill_groups(touch: Flags, group: Ints) -> int:
    """Fill group (candidate,) with numbers from 0, in the order of their first candidates; returns how many."""
    group[:] = -1
    waiting = np.empty(len(group), np.int64)
    found = 0
    for first in range(len(group)):
        if group[first] >= 0:
            continue
        group[first], waiting[0], left = found, first, 1
        while left > 0:
            left -= 1
            i = waiting[left]
            for j in range(len(group)):
                if touch[i, j] and group[j] < 0:
                    group[j], waiting[left] = found, j
                    left += 1
        found += 1
    return found


@kernel
def alone(case: Problem, own: Ints) -> Problem:
    """A case with the boxes and walkers alone that a group (n,) may have or be; candidates keep their numbers."""
    boxes = case.boxes
    number = np.zeros(len(boxes.boxes), np.int64)
    kept = np.zeros((len(boxes.boxes), boxes.match.shape[2]), np.int64)
    for view in range(len(boxes.boxes)):
        for b in range(boxes.boxes[view]):
            if _fits(boxes.match[view, :, b][own], case).any():
                kept[view, number[view]] = b
                number[view] += 1
    most = number.max() if len(number) else 0
    match = np.full((len(number), boxes.match.shape[1], most), -np.inf)
    for view in range(len(number)):
        for i in own:
            for k in range(number[view]):
                match[view, i, k] = boxes.match[view, i, kept[view, k]]
    known = _walkers_of(case, own)
    part = BoxEvidence(match, number, boxes.cover, boxes.inside)
    return Problem(part, case.pixels, case.own, case.newcomer, known, case.ground, case.terms, case.owner, case.parts)


@kernel
def _walkers_of(case: Problem, own: Ints) -> Floats:
    """What speaks for each candidate by being each walker that somebody of a group may be, float64 (candidate, k)."""
    kept = np.zeros(case.known.shape[1], np.int64)
    count = 0
    for k in range(len(kept)):
        if ((case.newcomer + case.known[:, k])[own] > 0).any():
            kept[count] = k
            count += 1
    known = np.zeros((len(case.known), count))
    for i in own:
        for k in range(count):
            known[i, k] = case.known[i, kept[k]]
    return known
