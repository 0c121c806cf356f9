"""What is wrong with a recording rather than a camera's place: streams that are exchanged, or not of one time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from stseg.arrays import Floats
from stseg.calibrate.agreement import place
from stseg.calibrate.bystanders import Bystanders, find_bystanders, joined, mismatch
from stseg.calibrate.verdict import LEAST
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable

Shown = Mapping[int, Sequence[Floats]]
"""Of each frame, the boxes of every view, float64 (n, 4)."""
_BETTER = 1.3
"""How many times more boxes must find their people for streams to be called exchanged."""
_NEARER = 0.85
"""Share of the misfit that must be left at another time for a stream to be called late."""


@dataclass(frozen=True)
class Late:
    """A view whose frames are of another time.

    Attributes
    ----------
    view
        Its place in the rig.
    frames
        By how many frames it runs late; negative where it runs early.
    """

    view: int
    frames: int


def all_bystanders(rig: Rig, tables: Sequence[BodyTable], shown: Shown, frames: Sequence[int]) -> Bystanders:
    """The people of some frames, see `find_bystanders`."""
    nobody = Bystanders(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0), np.zeros((0, len(tables), 4)))
    return joined([nobody, *(find_bystanders(rig, tables, frame, shown[frame]) for frame in frames)])


def exchanged(
    rig: Rig, tables: Sequence[BodyTable], shown: Shown, frames: Sequence[int], people: Bystanders
) -> tuple[int, int] | None:
    """Two views whose streams fit far better the other way round, the best of all pairs of one size.

    Parameters
    ----------
    rig
    tables
        See `tables_of`.
    shown
    frames
        Those to look at.
    people
        Who was found in them as the rig has it.

    Returns
    -------
    (view, view), or None
    """
    best, pair = _BETTER * max(_fits(people), LEAST), None
    for first, second in combinations(range(len(tables)), 2):
        if rig.cameras[first].size != rig.cameras[second].size:
            continue
        order = list(range(len(tables)))
        order[first], order[second] = second, first
        turned = {frame: [shown[frame][view] for view in order] for frame in frames}
        fits = _fits(all_bystanders(rig, tables, turned, frames))
        if fits > best:
            best, pair = fits, (first, second)
    return pair


def _fits(people: Bystanders) -> float:
    """Boxes of people whom three views show, or two where there are no more."""
    count = people.seen.sum(axis=1)
    return float(count[count >= min(3, people.seen.shape[1])].sum())


def late(tables: Sequence[BodyTable], shown: Shown, people: Bystanders, most: int) -> list[Late]:
    """Views that show at another time what the others show now.

    Parameters
    ----------
    tables
    shown
        All frames, without gaps.
    people
        Who was found in some of them.
    most
        Frames by which a stream may be late or early.
    """
    found = []
    views = range(len(tables))
    for view in views:
        others = [other for other in views if other != view]
        placed = place(people, tables, others, min(2, len(others)))
        known = replace(people, ground=placed.ground, height=placed.height)
        shifts = [shift for shift in range(-most, most + 1)]
        misfit = np.array([_misfit(tables[view], view, shown, known, shift) for shift in shifts])
        if np.isfinite(misfit).all():
            best = int(misfit.argmin())
            if shifts[best] and misfit[best] < _NEARER * misfit[most]:
                found.append(Late(view, shifts[best]))
    return _likely(found, len(tables))


def _likely(found: list[Late], views: int) -> list[Late]:
    """Where most views seem late, it is the others that are early: time is told by the majority."""
    return found if 2 * len(found) <= views else []


def _misfit(table: BodyTable, view: int, shown: Shown, people: Bystanders, shift: int) -> float:
    """Mean distance, in gates and at most 1, from people to the nearest box that the view shows `shift` frames later."""
    body = table.boxes_of(people.ground, people.height)
    with np.errstate(invalid="ignore"):
        inside = (body[:, :2] > 1).all(axis=1) & (body[:, 2:] < np.array(table.size) - 2).all(axis=1)
    misses = []
    for frame in np.unique(people.frame[inside]).tolist():
        own = inside & (people.frame == frame)
        boxes = shown.get(frame + shift)
        if boxes is not None and len(boxes[view]):
            nearest = mismatch(table, people.ground[own], people.height[own], boxes[view]).min(axis=1)
            misses.append(np.minimum(nearest, 1.0))
    together = np.concatenate(misses) if misses else np.zeros(0)
    return float(together.mean()) if len(together) >= LEAST else np.nan
