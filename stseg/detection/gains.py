"""What one more person adds to a set, without scoring the set anew.

Pixels are the dear part of a score, and a newcomer changes whose they are only inside their own outline: with the
owners of the set at hand, the gain is a sum over that outline alone.
"""

from __future__ import annotations

from stseg.accelerate import kernel, part
from stseg.arrays import Ints
from stseg.detection.problem import Owners, Parameters, PixelEvidence, Problem
from stseg.detection.scoring import box_score, crowd, walker_score


@kernel
def fill_owners(members: Ints, count: int, pixels: PixelEvidence, owners: Owners) -> None:
    """Fill owners (view, v * u), -1 everywhere before, with the candidate whom each pixel shows of the set."""
    for a in range(count):
        come_in(members[a], pixels, owners)


@kernel
def wipe_owners(members: Ints, count: int, pixels: PixelEvidence, owners: Owners) -> None:
    """Make a set's owners -1 everywhere again."""
    for a in range(count):
        for view in range(len(pixels.raster)):
            first = pixels.first[view, members[a]]
            for k in range(_rows(first, pixels)):
                line = (first + k) * pixels.raster.shape[2]
                for u in range(pixels.spans[view, members[a], k, 0], pixels.spans[view, members[a], k, 1]):
                    owners[view, line + u] = -1


@kernel
def come_in(i: int, pixels: PixelEvidence, owners: Owners) -> None:
    """Candidate i comes in: theirs is what nobody nearer covers."""
    for view in range(len(pixels.raster)):
        first, away = pixels.first[view, i], pixels.order[view]
        for k in range(_rows(first, pixels)):
            line = (first + k) * pixels.raster.shape[2]
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = owners[view, line + u]
                if before < 0 or away[before] > away[i]:
                    owners[view, line + u] = i


@kernel
def leave(i: int, members: Ints, count: int, pixels: PixelEvidence, owners: Owners) -> None:
    """Candidate i leaves: what was theirs is that of the nearest left, the first `count` members, who covers it."""
    for view in range(len(pixels.raster)):
        first, spans, away = pixels.first[view], pixels.spans[view], pixels.order[view]
        rows = _rows(first[i], pixels)
        for k in range(rows):
            line = (first[i] + k) * pixels.raster.shape[2]
            for u in range(spans[i, k, 0], spans[i, k, 1]):
                if owners[view, line + u] == i:
                    owners[view, line + u] = -1
        for a in range(count):
            j = members[a]
            lower = first[j] - first[i]
            for k in range(max(lower, 0), min(rows, lower + spans.shape[1]) if first[j] >= 0 else 0):
                line, below = (first[i] + k) * pixels.raster.shape[2], k - lower
                for u in range(max(spans[i, k, 0], spans[j, below, 0]), min(spans[i, k, 1], spans[j, below, 1])):
                    before = owners[view, line + u]
                    if before < 0 or away[before] > away[j]:
                        owners[view, line + u] = j


@part
def _rows(first: int, pixels: PixelEvidence) -> int:
    """Rows of an outline that begins at row `first` that may lie on the raster."""
    return min(pixels.spans.shape[2], pixels.raster.shape[1] - first) if first >= 0 else 0


@kernel
def paired(members: Ints, count: int, case: Problem) -> float:
    """What boxes and walkers say of a set, nats: they are paired anew whenever the set changes."""
    total = walker_score(members, count, case.known, case.newcomer, case.owner)
    for view in range(len(case.boxes.boxes)):
        total += box_score(view, members, count, case.boxes, case.terms, case.owner, case.parts[view])
    return total


@kernel
def gain_of(i: int, members: Ints, count: int, pairs: float, owners: Owners, case: Problem) -> float:
    """What candidate i adds to a set, nats.

    Parameters
    ----------
    members : int64 (candidate + 1,)
        The first `count` are the set; the next place is scratch.
    pairs
        The set's `paired`.
    owners
        The set's, from `fill_owners`.
    """
    members[count] = i
    return unpaired_gain(i, members, count, owners, case) + paired(members, count + 1, case) - pairs


@kernel
def unpaired_gain(i: int, members: Ints, count: int, owners: Owners, case: Problem) -> float:
    """What of that neither boxes nor walkers say."""
    gain = case.terms.person + case.own[i] - case.newcomer[i]
    for a in range(count):
        gain -= crowd(i, members[a], case.ground, case.terms.apart)
    return float(gain + _pixel_gain(i, case.pixels, case.terms, owners))


@kernel
def _pixel_gain(i: int, pixels: PixelEvidence, terms: Parameters, owners: Owners) -> float:
    columns = pixels.raster.shape[2]
    total = 0.0
    for view in range(len(pixels.raster)):
        first, raster, away = pixels.first[view, i], pixels.raster[view], pixels.order[view]
        if first < 0:
            continue
        free, lost = 0.0, 0.0
        for k in range(_rows(first, pixels)):
            line = (first + k) * columns
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = owners[view, line + u]
                if before < 0:
                    free += raster[first + k, u]
                elif away[before] > away[i]:
                    free += raster[first + k, u]
                    lost += raster[first + k, u] / pixels.area[view, before]
        total += free / pixels.area[view, i] - lost
    return float(terms.body_weight * total)
