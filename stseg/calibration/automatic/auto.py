"""Calibration from upright people: endpoints in, checked solution out (the core of `stseg calibrate auto`).

Pairwise alignments are merged: views join one ground greedily by their joint support.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.calibration.adjusted_rig import cameras_of, centred, grid_of
from stseg.calibration.automatic.endpoints import Endpoints
from stseg.calibration.automatic.floor_features import floor_marks
from stseg.calibration.automatic.solution import (
    ROUNDS,
    CalibrationInput,
    SolvedViews,
    refine_cameras,
    refine_with_marks,
    single_view_cameras,
    view_places,
)
from stseg.calibration.automatic.view_alignment import IDENTITY, Alignment, ViewPlaces, align, mirrored, support
from stseg.calibration.pinhole import moved
from stseg.errors import SourceError

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
    places: Sequence[ViewPlaces], frame_rate: float, most_delay: int, progress: Callable[[], None]
) -> dict[tuple[int, int], list[Alignment]]:
    """Alignments of every two views, by (lower index, higher index)."""
    found = {}
    for i, j in combinations(range(len(places)), 2):
        found[i, j] = align(places[i], places[j], frame_rate, most_delay)
        progress()
    return found


def merge_views(places: Sequence[ViewPlaces], pairs: Pairs) -> MergedViews:
    """Merge all views with the greatest total support.

    `places` are those of the people of each view on a ground of its own, `pairs` the alignments of `align_all`.
    """
    starts = [(one.support, i, j, one) for (i, j), several in pairs.items() for one in several[:2]]
    starts.sort(key=lambda start: -start[0])
    grown = [_grown(places, pairs, {i: IDENTITY, j: one}) for _, i, j, one in starts[:_STARTS]]
    return max(grown, key=lambda merged: float(merged.support.sum()), default=MergedViews({}, _agreements(places, {})))


def _grown(places: Sequence[ViewPlaces], pairs: Pairs, placed: dict[int, Alignment]) -> MergedViews:
    while len(placed) < len(places):
        offers = [offer for view in range(len(places)) if view not in placed for offer in _offers(view, pairs, placed)]
        judged = []
        for view, place in offers:
            joint = (support(places[k], places[view], way.inverse.then(place)) for k, way in placed.items())
            judged.append((sum(joint), view, place))
        if not judged:
            break
        _, view, place = max(judged, key=lambda one: one[0])
        placed = placed | {view: place}
    return MergedViews(placed, _agreements(places, placed))


def _offers(view: int, pairs: Pairs, placed: Mapping[int, Alignment]) -> list[tuple[int, Alignment]]:
    """Alignments that the merged views propose for another one."""
    return [
        (view, way.then(one if other < view else one.inverse))
        for other, way in placed.items()
        for one in pairs[min(other, view), max(other, view)]
    ]


def _agreements(places: Sequence[ViewPlaces], placed: Mapping[int, Alignment]) -> Floats:
    table = np.zeros((len(places), len(places)))
    for i, j in combinations(sorted(placed), 2):
        table[i, j] = table[j, i] = support(places[i], places[j], placed[i].inverse.then(placed[j]))
    return table


_FLOOR_ROUNDS = 2
"""Rounds of floor features: a better rig rectifies the floor better, which finds more features."""
_FLOOR_CELL = 0.1
"""Cell of the rectified floor, metres."""


def placed_views(single_cameras: Sequence[Floats], merged: MergedViews) -> Floats:
    """All cameras on the ground of the first view, float64 (view, 14)."""
    back = [merged.placed[k].inverse for k in range(len(single_cameras))]
    ways = [(float(np.angle(one.factor)), np.array([one.shift.real, one.shift.imag]), abs(one.factor)) for one in back]
    return np.array([moved(view, *way) for view, way in zip(single_cameras, ways, strict=True)])


def steps_of(views: int) -> int:
    """Number of progress calls of `calibrate_from_people`."""
    return views + views * (views - 1) // 2 + ROUNDS


def calibrate_from_people(names: Sequence[str], views: CalibrationInput, progress: Callable[[], None]) -> SolvedViews:
    """Calibrate cameras from the feet and heads of walking people alone.

    Parameters
    ----------
    names
        Names of the views in error messages.
    views
        Endpoints of isolated people in every view.
    progress
        Called after each step.

    Raises
    ------
    SourceError
        For a view with too few people, or one that does not show the same people at the same time.
    """
    if len(views.endpoints) < 2:
        raise SourceError(names[0] if names else "videos", "", f"{len(views.endpoints)} views", "two or more")
    for name, endpoints in zip(names, views.endpoints, strict=True):
        require_people(name, endpoints)
    single_cameras = single_view_cameras(views, progress)
    places = view_places(views, single_cameras)
    most = round(views.most_delay * views.frame_rate)
    merged = merge_views(places, align_all(places, views.frame_rate, most, progress))
    require_merged(names, places, merged, views.frame_rate, most)
    delay = np.array([merged.placed[k].delay for k in range(len(names))], np.int64)
    solution = refine_cameras(views, placed_views(single_cameras, merged), delay, progress)
    require_correspondences(names, solution)
    return centred(solution)


def sharpen_by_floor(
    views: CalibrationInput, solution: SolvedViews, backgrounds: Sequence[Bytes]
) -> tuple[SolvedViews, int]:
    """Refine a solution for views by floor features; returns their number too, 0 on a bare floor.

    `backgrounds` uint8 (v, u, 3) are the empty scene in each view.
    """
    names = [str(view) for view in range(len(backgrounds))]
    count = 0
    for _ in range(_FLOOR_ROUNDS):
        marks = floor_marks(backgrounds, cameras_of(solution, names), grid_of(solution, _FLOOR_CELL))
        if not len(marks):
            break
        solution, count = centred(refine_with_marks(views, solution, marks)), len(marks)
    return solution, count


_MIN_ENDPOINTS = 40
"""Isolated people (a person in a frame counts once) that a view needs."""
_MIN_FOOT_SPREAD = 0.25
"""Least standard deviation of their feet over the image, in body lengths."""
_MIN_AGREEMENT = 0.5
"""Least share of a view's people that agree with another view's."""


def require_people(name: str, endpoints: Endpoints) -> None:
    """Raise SourceError where a view shows too few isolated people, or people who do not walk."""
    if len(endpoints) < _MIN_ENDPOINTS:
        found = f"{len(endpoints)} isolated people (a person in a frame counts once)"
        expected = (
            f"at least {_MIN_ENDPOINTS}: a longer recording, one with fewer people, or --background if it is empty"
        )
        raise SourceError(name, "", found, expected)
    foot_spread = float(np.linalg.norm(endpoints.foot.std(axis=0)) / np.median(endpoints.length))
    if foot_spread < _MIN_FOOT_SPREAD:
        found = f"people who stay in one place (their feet move by {foot_spread:.2f} body lengths)"
        raise SourceError(name, "", found, "people who walk about")


def require_merged(
    names: Sequence[str], places: Sequence[ViewPlaces], merged: MergedViews, rate: float, most: int
) -> None:
    """Raise SourceError for a view that fits no other, or only when mirrored."""
    share = agreement_shares(places, merged)
    worst = int(np.argmin(share))
    for view in np.argsort(share):
        if share[view] < _MIN_AGREEMENT + 0.2 and (other := _mirror(int(view), places, merged, rate, most)) is not None:
            found = f"people who meet those of {names[other]} only in a mirror"
            raise SourceError(names[int(view)], "", found, "an image that is not mirrored")
    if share[worst] < _MIN_AGREEMENT:
        found = f"people who meet those of other views in {100 * share[worst]:.0f} % of what these see"
        expected = f"a view of the same ground at the same time, at most {most / rate:g} s apart (--most-delay)"
        raise SourceError(names[worst], "", found, expected)


def agreement_shares(places: Sequence[ViewPlaces], merged: MergedViews) -> Floats:
    """Share of the common frames in which each view agrees with its best partner, 0..1."""
    shares = np.zeros(len(places))
    for view, other in permutations(merged.placed, 2):
        delay_frames = merged.placed[other].delay - merged.placed[view].delay
        common = len(np.intersect1d(places[view].frame + delay_frames, places[other].frame))
        shares[view] = max(shares[view], min(merged.support[view, other] / max(common, _MIN_ENDPOINTS), 1.0))
    return shares


def _mirror(view: int, places: Sequence[ViewPlaces], merged: MergedViews, rate: float, most: int) -> int | None:
    """The view that agrees far better with the mirror image of this one, or None."""
    for other in np.argsort(-merged.support[view]):
        if other != view:
            found = align(places[int(other)], mirrored(places[view]), rate, most)
            if found and found[0].support > 1.5 * merged.support[view].max():
                return int(other)
    return None


def require_correspondences(names: Sequence[str], solution: SolvedViews) -> None:
    """Raise SourceError for a view with too few correspondences after the adjustment."""
    count = np.bincount(solution.problem.correspondences.view, minlength=len(names))
    worst = int(np.argmin(count))
    if count[worst] < _MIN_ENDPOINTS // 2:
        found = f"{count[worst]} correspondences with other views"
        raise SourceError(names[worst], "", found, f"at least {_MIN_ENDPOINTS // 2}")
