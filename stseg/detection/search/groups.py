"""Groups of candidates that interact, which can be decided apart (HW12 section IV-B).

Two candidates interact where their projections overlap in a view with pixels, where one hides the other or both fit one
box in a view with boxes, where both may continue one track, and where they stand too near for two bodies. The score of
a set is the sum of the scores of its groups, exactly.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.evidence.ragged_lists import Lists, append, lists_of
from stseg.detection.problem import BoxEvidence, PixelEvidence, Problem
from stseg.detection.score.repulsion import apart_of_bodies
from stseg.detection.score.sharing import Sharing
from stseg.detection.score.track_sharing import TrackSharing
from stseg.kernels.accelerate import kernel, part


@kernel
def fill_interactions(problem: Problem, sharing: Sharing, interacts: Flags) -> None:
    """Fill touch (candidate, candidate), symmetric: whether the gain of one depends on the other."""
    boxes, candidates = sharing.boxes, len(interacts)
    interacts[:] = False
    _join_lists(_followers(sharing.tracks), interacts)
    _join_lists(boxes.fitting, interacts)
    for view in range(boxes.views):
        for i in range(candidates):
            row = view * candidates + i
            for k in range(boxes.hidden.start[row], boxes.hidden.start[row + 1]):
                j = boxes.hidden.item[k]
                interacts[i, j] = interacts[j, i] = True
    for i in range(candidates):
        interacts[i, i] = True
        for j in range(i):
            if not interacts[i, j]:
                interacts[i, j] = interacts[j, i] = _overlap_on_ground(i, j, problem) or _overlap(i, j, problem.pixels)


@kernel
def _followers(tracks: TrackSharing) -> Lists:
    """The candidates who may continue each track."""
    followers, place = lists_of(np.bincount(tracks.may.item, minlength=len(tracks.holder)))
    for i in range(len(tracks.may.start) - 1):
        for k in range(tracks.may.start[i], tracks.may.start[i + 1]):
            append(followers, place, tracks.may.item[k], i, tracks.may.value[k])
    return followers


@part
def _join_lists(lists: Lists, interacts: Flags) -> None:
    """Let all of each list interact."""
    for row in range(len(lists.start) - 1):
        for a in range(lists.start[row], lists.start[row + 1]):
            for b in range(lists.start[row], a):
                i, j = lists.item[a], lists.item[b]
                interacts[i, j] = interacts[j, i] = True


@kernel
def _fits(match: Floats, problem: Problem) -> Flags:
    """Candidates that may gain by a box, from their matches (n,): bool (n,)."""
    return np.asarray(problem.parameters.box_log_ratio + match > np.log(problem.parameters.box_miss_rate))


@part
def _overlap_on_ground(i: int, j: int, problem: Problem) -> bool:
    room = 0.5 * problem.parameters.minimum_distance * (problem.breadth[i] + problem.breadth[j])
    if abs(problem.ground[i, 0] - problem.ground[j, 0]) > room:
        return False
    return bool(apart_of_bodies(i, j, problem.ground, problem.breadth) < problem.parameters.minimum_distance)


@part
def _overlap(i: int, j: int, pixels: PixelEvidence) -> bool:
    """Whether their outlines share a pixel."""
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
def fill_groups(problem: Problem, sharing: Sharing, group: Ints) -> int:
    """Fill group (candidate,) with numbers from 0, in the order of their first candidates; returns how many.

    Candidates are compared on the ground and in pixels only where lists have not brought them together before.
    """
    boxes, tracks, candidates = sharing.boxes, sharing.tracks, len(group)
    followers, known = _followers(tracks), np.zeros(len(boxes.fitting.start) + len(tracks.holder), np.bool_)
    group[:] = -1
    waiting = np.empty(candidates, np.int64)
    found = 0
    for first in range(candidates):
        if group[first] >= 0:
            continue
        group[first], waiting[0], left = found, first, 1
        while left > 0:
            left -= 1
            i = waiting[left]
            for k in range(tracks.may.start[i], tracks.may.start[i + 1]):
                track = tracks.may.item[k]
                left = _take_row(followers, track, known, len(known) - 1 - track, found, group, waiting, left)
            for view in range(boxes.views):
                row = view * candidates + i
                for k in range(boxes.fits.start[row], boxes.fits.start[row + 1]):
                    box = view * boxes.boxes + boxes.fits.item[k]
                    left = _take_row(boxes.fitting, box, known, box, found, group, waiting, left)
                left = _take(boxes.hidden, row, found, group, waiting, left)
                left = _take(boxes.hiders, row, found, group, waiting, left)
            for j in range(candidates):
                if group[j] < 0 and (_overlap_on_ground(i, j, problem) or _overlap(i, j, problem.pixels)):
                    group[j], waiting[left] = found, j
                    left += 1
        found += 1
    return found


@part
def _take_row(
    lists: Lists, row: int, known: Flags, place: int, found: int, group: Ints, waiting: Ints, left: int
) -> int:
    """`_take` a row of lists whose candidates all interact, if it was not taken before: known (place,) says so."""
    if known[place]:
        return left
    known[place] = True
    return _take(lists, row, found, group, waiting, left)


@part
def _take(lists: Lists, row: int, found: int, group: Ints, waiting: Ints, left: int) -> int:
    """Take the candidates of a row of lists into a group; returns how many are waiting then."""
    for k in range(lists.start[row], lists.start[row + 1]):
        j = lists.item[k]
        if group[j] < 0:
            group[j], waiting[left] = found, j
            left += 1
    return left


@kernel
def restricted(problem: Problem, own: Ints) -> Problem:
    """A problem with the boxes and tracks alone that a group (n,) may take; candidates keep their numbers."""
    boxes = problem.boxes
    number = np.zeros(len(boxes.boxes), np.int64)
    kept = np.zeros((len(boxes.boxes), boxes.match.shape[2]), np.int64)
    for view in range(len(boxes.boxes)):
        for b in range(boxes.boxes[view]):
            if _fits(boxes.match[view, :, b][own], problem).any():
                kept[view, number[view]] = b
                number[view] += 1
    most = number.max() if len(number) else 0
    match = np.full((len(number), boxes.match.shape[1], most), -np.inf)
    for view in range(len(number)):
        for i in own:
            for k in range(number[view]):
                match[view, i, k] = boxes.match[view, i, kept[view, k]]
    known = _tracks_of(problem, own)
    part = BoxEvidence(match, number, boxes.hiders, boxes.inside, boxes.left)
    return Problem(
        part,
        problem.pixels,
        problem.size_prior,
        problem.birth_cost,
        known,
        problem.ground,
        problem.breadth,
        problem.parameters,
        problem.assigned,
        problem.owner,
        problem.view_evidence,
    )


@kernel
def _tracks_of(problem: Problem, own: Ints) -> Floats:
    """Gains of the tracks that a group may continue, float64 (candidate, k)."""
    kept = np.zeros(problem.track_gain.shape[1], np.int64)
    count = 0
    for k in range(len(kept)):
        if ((problem.birth_cost + problem.track_gain[:, k])[own] > 0).any():
            kept[count] = k
            count += 1
    known = np.zeros((len(problem.track_gain), count))
    for i in own:
        for k in range(count):
            known[i, k] = problem.track_gain[i, kept[k]]
    return known
