"""Which view disagrees with the others, and by how much.

What a view shows beside what the others say (`agreement`) is smoothed over the ground: a plane for the middle, the
heads and the feet each, so that a turned or tilted camera is told from noise as well as a shifted one. What all views
share (a box's edges lie beyond a body's) is no disagreement and is taken off. A view is named when it is off by more
than a cell and when, of those that are most off, taking off its disagreement makes all agree best; the rest is judged
after that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats
from stseg.calibration.box_correspondence import Bystanders, whole_in
from stseg.calibration.leave_one_out import edges, place
from stseg.geometry import Camera, Rig
from stseg.geometry.bodies import BodyTable

LEAST = 20
"""People that a statement on a view needs."""
_ROUNDS = 15
_FEET, _HIDDEN = 2, 0.35
"""The column of the feet, and what a lower edge above them counts: others and furniture hide feet."""
_SUSPECTS = 3
"""Views that are tried as the one to blame, those that are most off."""


@dataclass(frozen=True)
class Disagreement:
    """How one view stands to others.

    Attributes
    ----------
    view
        Its place in the rig.
    others
        Number of views that it was held against.
    people
        Number of people (a person in a frame counts once) that it was asked about.
    confirmed
        Share of those within its image whom it shows.
    feet, heads
        Root mean square of the smoothed disagreement across the line of sight at feet and heads, metres.
    right, down
        Its mean at the feet: where the view shows people, seen from where the others say, metres.
    scatter
        Of single people around the smoothed disagreement, metres.
    ground
        How far apart on the ground the two put people's feet, root mean square, metres.
    pixels
        The same in the view's image.
    """

    view: int
    others: int
    people: int
    confirmed: float
    feet: float
    heads: float
    right: float
    down: float
    scatter: float
    ground: float
    pixels: float

    @property
    def off(self) -> float:
        """What of it is likely to be the view's own fault, the larger of feet and heads, metres.

        Where every view errs by s, one of them and the mean of m others are s sqrt(1 + 1 / m) apart.
        """
        return max(self.feet, self.heads) / math.sqrt(1 + 1 / self.others)


@dataclass(frozen=True)
class _Raw:
    """One view's disagreement before what all share is taken off.

    Attributes
    ----------
    planes
        Smoothed over the ground.
    field : float64 (n, 3)
        The same of each person: middle to the right, head and feet downwards, metres across the line of sight.
    scale : float64 (n,)
        Pixels a metre at each person.
    slope : float64 (n, 2, 2)
        Ground metres a pixel at each person's feet.
    """

    view: int
    others: int
    confirmed: float
    planes: _Planes
    field: Floats
    scatter: float
    scale: Floats
    slope: Floats

    @property
    def mean(self) -> Floats:
        return np.asarray(self.field.mean(axis=0))

    def without(self, shared: Floats) -> Disagreement:
        """What is left once that is taken off which all views share, in the form and units of `field`."""
        field = self.field - shared
        feet = field[:, [0, 2]] * self.scale[:, None]
        moved = (self.slope @ feet[..., None])[..., 0]
        right, down = field[:, [0, 2]].mean(axis=0).tolist()
        return Disagreement(
            view=self.view,
            others=self.others,
            people=len(field),
            confirmed=self.confirmed,
            feet=_size(field[:, [0, 2]]),
            heads=_size(field[:, [0, 1]]),
            right=right,
            down=down,
            scatter=self.scatter,
            ground=_size(moved),
            pixels=_size(feet),
        )


def _raw(
    camera: Camera, tables: Sequence[BodyTable], people: Bystanders, view: int, others: Sequence[int]
) -> _Raw | None:
    placed = place(people, tables, others, min(2, len(others)))
    miss, known, tall = edges(tables[view], placed.ground, placed.height, people.box[:, view])
    with np.errstate(invalid="ignore"):
        across = np.where(known, miss / tall[:, None] * placed.height[:, None], np.nan)
    inside = whole_in(tables[view], placed.ground, placed.height)
    told = np.isfinite(across[:, 0])
    if told.sum() < LEAST:
        return None
    confirmed = float(people.seen[inside, view].mean()) if inside.any() else 0.0
    ground = placed.ground[told]
    planes = _smooth(ground, across[told])
    field = planes.at(ground)
    scatter = 1.4826 * float(np.nanmedian(np.abs(across[told, 0] - field[:, 0])))
    slope = np.asarray(np.linalg.inv(_slope(camera, ground)), float)
    return _Raw(view, len(others), confirmed, planes, field, scatter, tall[told] / placed.height[told], slope)


@dataclass(frozen=True)
class _Planes:
    """Planes over the ground: value and slope at a middle for each of several columns.

    Attributes
    ----------
    middle : float64 (2,)
        Metres.
    found : float64 (3, column)
        Value there, slope along x, slope along y.
    """

    middle: Floats
    found: Floats

    def at(self, ground: Floats) -> Floats:
        """Values at places (n, 2), float64 (n, column)."""
        return np.asarray(np.column_stack([np.ones(len(ground)), ground - self.middle]) @ self.found)


def _smooth(ground: Floats, across: Floats) -> _Planes:
    """Planes through middles, heads and feet (n, 3), nan where unknown: least absolute deviations, by reweighting."""
    middle = np.median(ground, axis=0)
    basis = np.column_stack([np.ones(len(ground)), ground - middle])
    found = np.zeros((3, across.shape[1]))
    for column in range(across.shape[1]):
        told = np.isfinite(across[:, column])
        if told.sum() < LEAST:
            continue
        own, value, weight = basis[told], across[told, column], np.ones(int(told.sum()))
        for _ in range(_ROUNDS):
            normal = (own * weight[:, None]).T @ own + np.diag([0.0, 1e-3, 1e-3])
            found[:, column] = np.linalg.solve(normal, (own * weight[:, None]).T @ value)
            rest = value - own @ found[:, column]
            hidden = _HIDDEN if column == _FEET else 1.0
            weight = np.where(rest < 0, hidden, 1.0) / np.maximum(np.abs(rest), 0.01)
    return _Planes(middle, found)


def _slope(camera: Camera, ground: Floats) -> Floats:
    """Pixels a metre of ground, float64 (n, 2, 2)."""
    step = 0.01
    columns = [
        (camera.project(ground + move, 0.0)[0] - camera.project(ground - move, 0.0)[0]) / (2 * step)
        for move in step * np.eye(2)
    ]
    return np.stack(columns, -1)


def _size(moves: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(moves**2, axis=1))))


@dataclass(frozen=True)
class Verdict:
    """What is to be said of a rig.

    Attributes
    ----------
    views
        How each view stands to all others, in the rig's order; None of whom too little is known.
    named
        Those that are off, the worst first, each beside the views that are left.
    quarrel
        Two views that disagree where there is no third to judge between them.
    """

    views: tuple[Disagreement | None, ...]
    named: tuple[Disagreement, ...]
    quarrel: tuple[Disagreement, Disagreement] | None


def judge(rig: Rig, tables: Sequence[BodyTable], people: Bystanders) -> Verdict:
    """Name the views that are off by more than a cell."""
    first = current = _all_raw(rig, tables, people)
    named: list[Disagreement] = []
    while len(_known(current)) > 2 and _worst(current) > rig.grid.cell and len(named) < len(rig.cameras) - 2:
        unnamed = [one for one in _known(current) if one.view not in {other.view for other in named}]
        suspects = sorted(unnamed, key=lambda one: -one.off)[:_SUSPECTS]
        trials = []
        for suspect in suspects:
            mended = _mended(people, tables[suspect.view], current[suspect.view])
            after = _all_raw(rig, tables, mended)
            trials.append((_spread(after), suspect, mended, after))
        if not trials:
            break
        _, worst, people, current = min(trials, key=lambda trial: trial[0])
        if worst.off <= rig.grid.cell:
            break
        named.append(worst)
    whole = _known(first)
    quarrel = (whole[0], whole[1]) if len(whole) == 2 and _worst(first) > rig.grid.cell else None
    return Verdict(tuple(_without_shared(first)), tuple(named), quarrel)


def _all_raw(rig: Rig, tables: Sequence[BodyTable], people: Bystanders) -> list[_Raw | None]:
    views = range(len(rig.cameras))
    return [_raw(rig.cameras[view], tables, people, view, [o for o in views if o != view]) for view in views]


def _without_shared(raw: Sequence[_Raw | None]) -> list[Disagreement | None]:
    """Disagreements less what all views share, where there are enough of them to say."""
    known = [one.mean for one in raw if one is not None]
    shared = _common(np.array(known)) if len(known) > 2 else np.zeros(3)
    return [None if one is None else one.without(shared) for one in raw]


def _common(means: Floats) -> Floats:
    """What rows (n, 3) have in common: the medians of heads and feet, which boxes and bodies make.

    To one side only the least, and where all go the same way: of two cameras that face each other both are off where
    one is.
    """
    right = means[:, 0]
    shared = np.median(means, axis=0)
    shared[0] = np.abs(right).min() * np.sign(right[0]) if np.abs(np.sign(right).sum()) == len(right) else 0.0
    return np.asarray(shared)


def _known(raw: Sequence[_Raw | None]) -> list[Disagreement]:
    return [one for one in _without_shared(raw) if one is not None]


def _mended(people: Bystanders, table: BodyTable, raw: _Raw | None) -> Bystanders:
    """The people as the view would show them without its disagreement."""
    if raw is None:
        return people
    body = table.boxes_of(people.ground, people.height)
    scale = (body[:, 3] - body[:, 1]) / people.height
    right, head, feet = (raw.planes.at(people.ground) * scale[:, None]).T
    box = people.box.copy()
    box[:, raw.view] -= np.stack([right, head, right, feet], -1)
    return replace(people, box=box)


def _worst(raw: Sequence[_Raw | None]) -> float:
    return max((one.off for one in _known(raw)), default=0.0)


def _spread(raw: Sequence[_Raw | None]) -> float:
    """Root mean square over the views."""
    return float(np.sqrt(np.mean([one.off**2 for one in _known(raw)])))
