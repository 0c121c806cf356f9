"""What one more person adds to a set, without scoring the set anew.

Pixels are the dear part of a score, and a newcomer changes whose they are only inside their own outline: with the
owners of the set at hand, the gain is a sum over that outline alone.
"""

from __future__ import annotations

from stseg.accelerate import kernel
from stseg.arrays import Ints
from stseg.ghosts.evidence import Case, PixelEvidence, Terms
from stseg.ghosts.scoring import box_score, crowd, walker_score


@kernel
def fill_owners(members: Ints, count: int, pixels: PixelEvidence, owners: Ints) -> None:
    """Fill owners (view, v * u) with the candidate whom each pixel shows, -1 for nobody of the set."""
    columns = pixels.raster.shape[2]
    for view in range(len(pixels.raster)):
        owners[view] = -1
        away = pixels.order[view]
        for a in range(count):
            i = members[a]
            first = pixels.first[view, i]
            if first < 0:
                continue
            for k in range(min(pixels.spans.shape[2], pixels.raster.shape[1] - first)):
                line = (first + k) * columns
                for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                    before = owners[view, line + u]
                    if before < 0 or away[before] > away[i]:
                        owners[view, line + u] = i


@kernel
def paired(members: Ints, count: int, case: Case) -> float:
    """What boxes and walkers say of a set, nats: they are paired anew whenever the set changes."""
    total = walker_score(members, count, case.known, case.newcomer, case.owner)
    for view in range(len(case.boxes.boxes)):
        total += box_score(view, members, count, case.boxes, case.terms, case.owner, case.parts[view])
    return total


@kernel
def gain_of(i: int, members: Ints, count: int, pairs: float, owners: Ints, case: Case) -> float:
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
    gain = case.terms.person + case.own[i] - case.newcomer[i] + paired(members, count + 1, case) - pairs
    for a in range(count):
        gain -= crowd(i, members[a], case.ground, case.terms.apart)
    return float(gain + _pixel_gain(i, case.pixels, case.terms, owners))


@kernel
def _pixel_gain(i: int, pixels: PixelEvidence, terms: Terms, owners: Ints) -> float:
    columns = pixels.raster.shape[2]
    total = 0.0
    for view in range(len(pixels.raster)):
        first, raster, away = pixels.first[view, i], pixels.raster[view], pixels.order[view]
        if first < 0:
            continue
        for k in range(min(pixels.spans.shape[2], len(raster) - first)):
            line = (first + k) * columns
            for u in range(pixels.spans[view, i, k, 0], pixels.spans[view, i, k, 1]):
                before = owners[view, line + u]
                if before < 0:
                    total += raster[first + k, u] / pixels.area[view, i]
                elif away[before] > away[i]:
                    total += raster[first + k, u] * (1.0 / pixels.area[view, i] - 1.0 / pixels.area[view, before])
    return float(terms.body_weight * total)
