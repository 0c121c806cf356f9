"""What is wrong with a recording rather than a camera's place: streams that are exchanged, or not of one time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.box_correspondence import GATE, Bystanders, find_bystanders, joined, mismatch, whole_in
from stseg.calibration.leave_one_out import edges, place
from stseg.calibration.verdict import LEAST
from stseg.geometry import Rig
from stseg.geometry.bodies import BodyTable

Shown = Mapping[int, Sequence[Floats]]
"""Of each frame, the boxes of every view, float64 (n, 4)."""
_BETTER = 1.3
"""How many times more boxes must find their people for streams to be called exchanged."""
_CLOSE = 0.35
"""Gates within which a box fits a person whom all views place."""
_NEARER = 0.75
"""Share of the misfit that may be left at another time for a stream to be called late."""


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
    best, pair = _BETTER * max(_fits(tables, people), LEAST), None
    for first, second in combinations(range(len(tables)), 2):
        if rig.cameras[first].size != rig.cameras[second].size:
            continue
        order = list(range(len(tables)))
        order[first], order[second] = second, first
        turned = {frame: [shown[frame][view] for view in order] for frame in frames}
        fits = _fits(tables, all_bystanders(rig, tables, turned, frames))
        if fits > best:
            best, pair = fits, (first, second)
    return pair


def _fits(tables: Sequence[BodyTable], people: Bystanders) -> int:
    """Boxes that lie close to where all views together place their people."""
    views = len(tables)
    placed = place(people, tables, range(views), min(3, views))
    told = np.isfinite(placed.height)
    count = 0
    for view, table in enumerate(tables):
        miss, known, tall = edges(table, placed.ground[told], placed.height[told], people.box[told, view])
        with np.errstate(invalid="ignore"):
            off = np.hypot(miss[:, 0], miss[:, 1]) / tall
            count += int((known[:, :2].all(axis=1) & (off < _CLOSE * GATE)).sum())
    return count


def late(tables: Sequence[BodyTable], shown: Shown, people: Bystanders, most: int) -> Late | None:
    """The view that most clearly shows at another time what the others show now.

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
    clearest, found = _NEARER, None
    shifts = range(-most, most + 1)
    for view in range(len(tables)):
        others = [other for other in range(len(tables)) if other != view]
        placed = place(people, tables, others, min(2, len(others)))
        known = replace(people, ground=placed.ground, height=placed.height)
        misfit = np.array([_misfit(tables[view], view, shown, known, shift) for shift in shifts])
        if not np.isfinite(misfit).all():
            continue
        best = int(misfit.argmin())
        if misfit[best] < clearest * misfit[most]:
            clearest, found = float(misfit[best] / misfit[most]), Late(view, shifts[best])
    return found


def in_time(shown: Shown, one: Late, size: int) -> dict[int, list[Floats]]:
    """The boxes with the late view's brought back to their time; none where that is beyond its end."""
    nothing = [np.zeros((0, 4))] * size
    return {
        frame: [
            shown.get(frame + one.frames, nothing)[view] if view == one.view else own for view, own in enumerate(boxes)
        ]
        for frame, boxes in shown.items()
    }


def _misfit(table: BodyTable, view: int, shown: Shown, people: Bystanders, shift: int) -> float:
    """How far the nearest boxes `shift` frames later scatter around a plane over the ground, in bodies' heights.

    The plane itself says nothing of time: a camera that is off, or turned, has it too.
    """
    inside = whole_in(table, people.ground, people.height)
    offsets, places = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for frame in np.unique(people.frame[inside]).tolist():
        own = np.flatnonzero(inside & (people.frame == frame))
        boxes = shown.get(frame + shift)
        if boxes is None or not len(boxes[view]):
            continue
        apart = mismatch(table, people.ground[own], people.height[own], boxes[view])
        met = np.isfinite(apart.min(axis=1))
        nearest = boxes[view][apart.argmin(axis=1)[met]]
        miss, _, tall = edges(table, people.ground[own[met]], people.height[own[met]], nearest)
        offsets.append(miss[:, :2] / tall[:, None])
        places.append(people.ground[own[met]])
    together, ground = np.concatenate(offsets), np.concatenate(places)
    if len(together) < LEAST:
        return np.nan
    basis = np.column_stack([np.ones(len(ground)), ground])
    rest = together - basis @ np.linalg.lstsq(basis, together)[0]
    return float(np.median(np.hypot(*rest.T)))
