"""Merging of pairwise alignments: views join one ground greedily by their joint support."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.automatic.view_alignment import IDENTITY, Alignment, ViewPaths, align, support

_STARTS = 4
"""Number of view pairs from which merging is started."""

Pairs = Mapping[tuple[int, int], Sequence[Alignment]]


@dataclass(frozen=True)
class MergedViews:
    """Views on one ground."""

    placed: dict[int, Alignment]
    """Alignment from the first view to each view, by index; views that fit nowhere are missing."""
    support: Floats
    """float64 (view, view): support between each two merged views."""


def align_all(
    paths: Sequence[ViewPaths], frame_rate: float, most_delay: int, progress: Callable[[], None]
) -> dict[tuple[int, int], list[Alignment]]:
    """Alignments of every two views, by (lower index, higher index)."""
    found = {}
    for i, j in combinations(range(len(paths)), 2):
        found[i, j] = align(paths[i], paths[j], frame_rate, most_delay)
        progress()
    return found


def merge_views(paths: Sequence[ViewPaths], pairs: Pairs) -> MergedViews:
    """Merge all views with the greatest total support.

    Parameters
    ----------
    paths
        Paths of each view on a ground of its own.
    pairs
        Alignments of every two views, see `align_all`.
    """
    starts = [(one.support, i, j, one) for (i, j), several in pairs.items() for one in several[:2]]
    starts.sort(key=lambda start: -start[0])
    grown = [_grown(paths, pairs, {i: IDENTITY, j: one}) for _, i, j, one in starts[:_STARTS]]
    return max(grown, key=lambda merged: float(merged.support.sum()), default=MergedViews({}, _agreements(paths, {})))


def _grown(paths: Sequence[ViewPaths], pairs: Pairs, placed: dict[int, Alignment]) -> MergedViews:
    while len(placed) < len(paths):
        offers = [offer for view in range(len(paths)) if view not in placed for offer in _offers(view, pairs, placed)]
        judged = [(_joint_support(paths, placed, view, place), view, place) for view, place in offers]
        if not judged:
            break
        _, view, place = max(judged, key=lambda one: one[0])
        placed = placed | {view: place}
    return MergedViews(placed, _agreements(paths, placed))


def _offers(view: int, pairs: Pairs, placed: Mapping[int, Alignment]) -> list[tuple[int, Alignment]]:
    """Alignments that the merged views propose for another one."""
    return [
        (view, way.then(one if other < view else one.inverse))
        for other, way in placed.items()
        for one in pairs[min(other, view), max(other, view)]
    ]


def _joint_support(paths: Sequence[ViewPaths], placed: Mapping[int, Alignment], view: int, place: Alignment) -> float:
    return sum(support(paths[other], paths[view], way.inverse.then(place)) for other, way in placed.items())


def _agreements(paths: Sequence[ViewPaths], placed: Mapping[int, Alignment]) -> Floats:
    table = np.zeros((len(paths), len(paths)))
    for i, j in combinations(sorted(placed), 2):
        table[i, j] = table[j, i] = support(paths[i], paths[j], placed[i].inverse.then(placed[j]))
    return table
