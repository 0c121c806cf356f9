"""All views on one ground: each joins those already placed where most of its people agree with all of theirs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.view_alignment import SAME, Alignment, Walks, align, support

_STARTS = 4
"""Pairs of views from which an assembly is started."""

Pairs = Mapping[tuple[int, int], Sequence[Alignment]]


@dataclass(frozen=True)
class Assembly:
    """Views on one ground.

    Attributes
    ----------
    placed
        From the first view that was placed to each view, by the view's number; views that fit nowhere are left out.
    support : float64 (view, view)
        Agreements between each two placed views.
    """

    placed: dict[int, Alignment]
    support: Floats


def align_all(
    walks: Sequence[Walks], frame_rate: float, most_delay: int, progress: Callable[[], None]
) -> dict[tuple[int, int], list[Alignment]]:
    """The alignments of every two views, by (lower number, higher number)."""
    found = {}
    for i, j in combinations(range(len(walks)), 2):
        found[i, j] = align(walks[i], walks[j], frame_rate, most_delay)
        progress()
    return found


def assemble(walks: Sequence[Walks], pairs: Pairs) -> Assembly:
    """The assembly in which most people agree.

    Parameters
    ----------
    walks
        Each view's people on a ground of its own.
    pairs
        Alignments of every two views, see `align_all`.
    """
    starts = [(one.support, i, j, one) for (i, j), several in pairs.items() for one in several[:2]]
    starts.sort(key=lambda start: -start[0])
    grown = [_grown(walks, pairs, {i: SAME, j: one}) for _, i, j, one in starts[:_STARTS]]
    return max(grown, key=lambda assembly: float(assembly.support.sum()), default=Assembly({}, _agreements(walks, {})))


def _grown(walks: Sequence[Walks], pairs: Pairs, placed: dict[int, Alignment]) -> Assembly:
    while len(placed) < len(walks):
        offers = [offer for view in range(len(walks)) if view not in placed for offer in _offers(view, pairs, placed)]
        judged = [(_joint_support(walks, placed, view, place), view, place) for view, place in offers]
        if not judged:
            break
        _, view, place = max(judged, key=lambda one: one[0])
        placed = placed | {view: place}
    return Assembly(placed, _agreements(walks, placed))


def _offers(view: int, pairs: Pairs, placed: Mapping[int, Alignment]) -> list[tuple[int, Alignment]]:
    """Where the placed views would have another one."""
    return [
        (view, way.then(one if other < view else one.inverse))
        for other, way in placed.items()
        for one in pairs[min(other, view), max(other, view)]
    ]


def _joint_support(walks: Sequence[Walks], placed: Mapping[int, Alignment], view: int, place: Alignment) -> float:
    return sum(support(walks[other], walks[view], way.inverse.then(place)) for other, way in placed.items())


def _agreements(walks: Sequence[Walks], placed: Mapping[int, Alignment]) -> Floats:
    table = np.zeros((len(walks), len(walks)))
    for i, j in combinations(sorted(placed), 2):
        table[i, j] = table[j, i] = support(walks[i], walks[j], placed[i].inverse.then(placed[j]))
    return table
