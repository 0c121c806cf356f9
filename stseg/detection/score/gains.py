"""Gain of one more person, without scoring the set anew.

Pixels are the dear part of a score, and one more person changes their assignment only inside the person's outline: with
the set's assignment at hand, the gain is a sum over that outline alone.
"""

from __future__ import annotations

from stseg.arrays import Flags, Ints
from stseg.detection.problem import Parameters, PixelAssignment, PixelEvidence, Problem
from stseg.detection.score.box_sharing import box_gain, known_box_gain
from stseg.detection.score.scoring import crowd
from stseg.detection.score.sharing import Sharing
from stseg.detection.score.track_sharing import gain_of_track
from stseg.kernels.accelerate import kernel, part


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
def gain_of(
    i: int, members: Ints, count: int, inside: Flags, assigned: PixelAssignment, problem: Problem, sharing: Sharing
) -> float:
    """Gain of candidate i, nats.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        The first `count` are the set.
    inside : bool (candidate,)
        The set, beside members of other groups; without i.
    assigned
        The set's, from `fill_assignment`.
    sharing
        Its tracks are assigned to the set, and what is known of boxes is that of the set, or of the set and i.
    """
    gain = unpaired_gain(i, members, count, assigned, problem) + gain_of_track(i, sharing.tracks)
    return gain + known_box_gain(i, inside, sharing.boxes, problem.parameters)


@kernel
def gain_in_place(
    i: int, members: Ints, count: int, inside: Flags, assigned: PixelAssignment, problem: Problem, sharing: Sharing
) -> float:
    """The same where what is known of boxes is that of a set with a further member, whose place i would take."""
    gain = unpaired_gain(i, members, count, assigned, problem) + gain_of_track(i, sharing.tracks)
    return gain + box_gain(i, inside, sharing.boxes, problem.parameters)


@part
def unpaired_gain(i: int, members: Ints, count: int, assigned: PixelAssignment, problem: Problem) -> float:
    """The part of that gain that needs no matching: prior, crowding and pixels."""
    gain = problem.parameters.prior_log_odds + problem.size_prior[i] - problem.birth_cost[i]
    for a in range(count):
        gain -= crowd(i, members[a], problem)
    return float(gain + _pixel_gain(i, problem.pixels, problem.parameters, assigned))


@part
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
