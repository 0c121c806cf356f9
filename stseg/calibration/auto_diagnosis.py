"""What is wrong with videos from which no rig comes: too few people, other times, a mirror."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.calibration.endpoints import Ends
from stseg.calibration.solution import Solution
from stseg.calibration.view_alignment import Walks, align, mirrored
from stseg.calibration.view_merging import Assembly
from stseg.errors import SourceError

_LEAST_ENDS = 40
"""People and frames that a view must show by themselves."""
_LEAST_WAY = 0.25
"""Spread of their feet over the image, in lengths of a person."""
_LEAST_SHARE = 0.5
"""Of a view's people whom another view ought to meet, the share that must be met."""


def require_walkers(name: str, ends: Ends) -> None:
    """Raise SourceError where a view shows too few people by themselves, or people who stay where they are."""
    if len(ends) < _LEAST_ENDS:
        found = f"{len(ends)} people and frames in which somebody stands free, whole and alone"
        raise SourceError(name, "", found, f"at least {_LEAST_ENDS}: a longer recording, or one with fewer people")
    way = float(np.linalg.norm(ends.foot.std(axis=0)) / np.median(ends.length))
    if way < _LEAST_WAY:
        found = f"people who stay in one place (their feet move by {way:.2f} body lengths)"
        raise SourceError(name, "", found, "people who walk about")


def require_placed(names: Sequence[str], walks: Sequence[Walks], assembly: Assembly, rate: float, most: int) -> None:
    """Raise SourceError that names a view which fits nowhere, or fits only in a mirror."""
    share = met_shares(walks, assembly)
    worst = int(np.argmin(share))
    for view in np.argsort(share):
        if share[view] < _LEAST_SHARE + 0.2 and (other := _mirror(int(view), walks, assembly, rate, most)) is not None:
            found = f"people who meet those of {names[other]} only in a mirror"
            raise SourceError(names[int(view)], "", found, "an image that is not mirrored")
    if share[worst] < _LEAST_SHARE:
        found = f"people who meet those of other views in {100 * share[worst]:.0f} % of what these see"
        expected = f"a view of the same ground at the same time, at most {most / rate:g} s apart (--most-delay)"
        raise SourceError(names[worst], "", found, expected)


def met_shares(walks: Sequence[Walks], assembly: Assembly) -> list[float]:
    """For each view, the agreements with its best partner over the frames that both show people in, 0..1."""
    shares = []
    for view, own in enumerate(walks):
        best = 0.0
        for other, theirs in enumerate(walks):
            if other != view and view in assembly.placed and other in assembly.placed:
                late = assembly.placed[other].delay - assembly.placed[view].delay
                common = len(np.intersect1d(own.frame + late, theirs.frame))
                best = max(best, float(assembly.support[view, other]) / max(common, _LEAST_ENDS))
        shares.append(min(best, 1.0))
    return shares


def _mirror(view: int, walks: Sequence[Walks], assembly: Assembly, rate: float, most: int) -> int | None:
    """The view whose people agree far better with the mirror image of this one; None where none does."""
    for other in np.argsort(-assembly.support[view]):
        if other != view:
            found = align(walks[int(other)], mirrored(walks[view]), rate, most)
            if found and found[0].support > 1.5 * assembly.support[view].max():
                return int(other)
    return None


def require_met(names: Sequence[str], solution: Solution) -> None:
    """Raise SourceError for a view that hardly anybody was met in after the adjustment."""
    count = np.bincount(solution.task.seen.view, minlength=len(names))
    worst = int(np.argmin(count))
    if count[worst] < _LEAST_ENDS // 2:
        found = f"{count[worst]} people and frames that other views see too"
        raise SourceError(names[worst], "", found, f"at least {_LEAST_ENDS // 2}")
