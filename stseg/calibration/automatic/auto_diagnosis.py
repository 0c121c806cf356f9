"""Diagnosis of videos that cannot be calibrated: too few people, different times, a mirrored image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.calibration.automatic.endpoints import Endpoints
from stseg.calibration.automatic.solution import Solution
from stseg.calibration.automatic.view_alignment import ViewPaths, align, mirrored
from stseg.calibration.automatic.view_merging import MergedViews
from stseg.errors import SourceError

_LEAST_ENDS = 40
"""Isolated people (a person in a frame counts once) that a view needs."""
_LEAST_WAY = 0.25
"""Least standard deviation of their feet over the image, in body lengths."""
_LEAST_SHARE = 0.5
"""Least share of a view's people that agree with another view's."""


def require_people(name: str, endpoints: Endpoints) -> None:
    """Raise SourceError where a view shows too few isolated people, or people who do not walk."""
    if len(endpoints) < _LEAST_ENDS:
        found = f"{len(endpoints)} isolated people (a person in a frame counts once)"
        raise SourceError(name, "", found, f"at least {_LEAST_ENDS}: a longer recording, or one with fewer people")
    way = float(np.linalg.norm(endpoints.foot.std(axis=0)) / np.median(endpoints.length))
    if way < _LEAST_WAY:
        found = f"people who stay in one place (their feet move by {way:.2f} body lengths)"
        raise SourceError(name, "", found, "people who walk about")


def require_merged(
    names: Sequence[str], paths: Sequence[ViewPaths], merged: MergedViews, rate: float, most: int
) -> None:
    """Raise SourceError for a view that fits no other, or only when mirrored."""
    share = agreement_shares(paths, merged)
    worst = int(np.argmin(share))
    for view in np.argsort(share):
        if share[view] < _LEAST_SHARE + 0.2 and (other := _mirror(int(view), paths, merged, rate, most)) is not None:
            found = f"people who meet those of {names[other]} only in a mirror"
            raise SourceError(names[int(view)], "", found, "an image that is not mirrored")
    if share[worst] < _LEAST_SHARE:
        found = f"people who meet those of other views in {100 * share[worst]:.0f} % of what these see"
        expected = f"a view of the same ground at the same time, at most {most / rate:g} s apart (--most-delay)"
        raise SourceError(names[worst], "", found, expected)


def agreement_shares(paths: Sequence[ViewPaths], merged: MergedViews) -> list[float]:
    """Share of the common frames in which each view agrees with its best partner, 0..1."""
    shares = []
    for view, own in enumerate(paths):
        best = 0.0
        for other, theirs in enumerate(paths):
            if other != view and view in merged.placed and other in merged.placed:
                delay_frames = merged.placed[other].delay - merged.placed[view].delay
                common = len(np.intersect1d(own.frame + delay_frames, theirs.frame))
                best = max(best, float(merged.support[view, other]) / max(common, _LEAST_ENDS))
        shares.append(min(best, 1.0))
    return shares


def _mirror(view: int, paths: Sequence[ViewPaths], merged: MergedViews, rate: float, most: int) -> int | None:
    """The view that agrees far better with the mirror image of this one, or None."""
    for other in np.argsort(-merged.support[view]):
        if other != view:
            found = align(paths[int(other)], mirrored(paths[view]), rate, most)
            if found and found[0].support > 1.5 * merged.support[view].max():
                return int(other)
    return None


def require_correspondences(names: Sequence[str], solution: Solution) -> None:
    """Raise SourceError for a view with too few correspondences after the adjustment."""
    count = np.bincount(solution.problem.correspondences.view, minlength=len(names))
    worst = int(np.argmin(count))
    if count[worst] < _LEAST_ENDS // 2:
        found = f"{count[worst]} correspondences with other views"
        raise SourceError(names[worst], "", found, f"at least {_LEAST_ENDS // 2}")
