"""Disagreement of each view with the others, and which views are displaced.

Leave-one-out residuals are smoothed over the ground by a plane for the middle, the heads and the feet each, which shows
a turned or tilted camera as well as a shifted one. A component common to all views (a box's edges lie beyond a body's)
is removed. A view is reported when it is off by more than a cell beyond two standard errors, and when correcting it,
among the most displaced ones, makes all views agree best; the others are judged after the correction.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats
from stseg.bodies.pillars import BodyTable
from stseg.calibration.check.box_correspondence import SPANS, BoxCorrespondences, spans, wholly_visible
from stseg.calibration.check.leave_one_out import edge_residuals, locate
from stseg.calibration.pinhole import ground_jacobian
from stseg.geometry import Camera, Rig

MIN_PEOPLE = 20
"""Least number of people (a person in a frame counts once) for a statement on a view."""
_ROUNDS = 15
_DIFFERENCE = 0.01
"""Step of the finite differences, metres."""
_ABOVE_WEIGHT = (1.0, 0.35, 0.35)
"""Weights of negative residuals of middles, heads and feet: blobs of heads hold others behind, and what hides feet
leaves a lower edge above them."""
_SUSPECTS = 3
"""Number of the most displaced views that are tried as the cause."""


@dataclass(frozen=True)
class Disagreement:
    """Disagreement of one view with the others."""

    view: int
    """Index in the rig."""
    others: int
    """Number of views it was compared with."""
    people: int
    """Number of people compared (a person in a frame counts once)."""
    confirmed: float
    """Share of the people inside its image that it shows."""
    feet: float
    heads: float
    """Root mean square of the smoothed disagreement across the viewing ray at feet and heads, metres."""
    feet_error: float
    heads_error: float
    """Root mean square of their standard errors, metres."""
    right: float
    down: float
    """Its mean at the feet: the view's people against the others', metres."""
    ground: float
    """Root mean square distance of the feet on the ground, metres."""
    pixels: float
    """The same in the view's image."""

    @property
    def off(self) -> float:
        """Displacement likely due to the view itself, the larger of feet and heads, metres.

        Its mean square is that of the disagreement less that of its error. Where every view errs by s, one of them and
        the mean of m others are s sqrt(1 + 1 / m) apart.
        """
        square = max(self.feet**2 - self.feet_error**2, self.heads**2 - self.heads_error**2, 0.0)
        return math.sqrt(square / (1 + 1 / self.others))

    @property
    def error(self) -> float:
        """Standard error of the displacement, metres."""
        return max(self.feet_error, self.heads_error) / math.sqrt(1 + 1 / self.others)

    @property
    def certainly_off(self) -> float:
        """The same less two standard errors: at least so much, metres."""
        least = max(self.feet - 2 * self.feet_error, self.heads - 2 * self.heads_error, 0.0)
        return least / math.sqrt(1 + 1 / self.others)


@dataclass(frozen=True)
class _RawDisagreement:
    """Disagreement of one view before the common component is removed."""

    view: int
    others: int
    confirmed: float
    middle: Floats
    planes: Floats
    """Smoothed over the ground: place (2,), metres; value there, slope along x and y of each column (3, column)."""
    field: Floats
    """float64 (n, 3): the same of each person: middle to the right, head and feet downwards, metres across the viewing
    ray."""
    variance: Floats
    """float64 (n, 3): variances of `field`, square metres."""
    scale: Floats
    """float64 (n,): pixels a metre at each person."""
    slope: Floats
    """float64 (n, 2, 2): ground metres a pixel at each person's feet."""

    @property
    def mean(self) -> Floats:
        return np.asarray(self.field.mean(axis=0))

    def without(self, shared: Floats) -> Disagreement:
        """The disagreement without the component common to all views (a row of `field`)."""
        field = self.field - shared
        feet = field[:, [0, 2]] * self.scale[:, None]
        moved = (self.slope @ feet[..., None])[..., 0]
        right, down = field[:, [0, 2]].mean(axis=0).tolist()
        compared = (self.view, self.others, len(field), self.confirmed)
        ends = (_size(field[:, [0, 2]]), _size(field[:, [0, 1]]))
        errors = (_size(np.sqrt(self.variance[:, [0, 2]])), _size(np.sqrt(self.variance[:, [0, 1]])))
        return Disagreement(*compared, *ends, *errors, right, down, _size(moved), _size(feet))


def _raw_disagreement(
    camera: Camera, tables: Sequence[BodyTable], people: BoxCorrespondences, view: int, others: Sequence[int]
) -> _RawDisagreement | None:
    located = locate(people, tables, others, min(2, len(others)))
    residual, uncut, pixel_height = edge_residuals(tables[view], located.ground, located.height, people.box[:, view])
    with np.errstate(invalid="ignore"):
        across = np.where(uncut, residual / pixel_height[:, None] * located.height[:, None], np.nan)
    inside = wholly_visible(tables[view], located.ground, located.height)
    measured = np.isfinite(across[:, 0])
    if measured.sum() < MIN_PEOPLE:
        return None
    confirmed = float(people.has_box[inside, view].mean()) if inside.any() else 0.0
    ground, across = located.ground[measured], across[measured]
    across[:, np.isfinite(across).sum(axis=0) < MIN_PEOPLE] = np.nan
    middle, planes = _smooth(ground, across)
    field, variance = _on_planes(ground, middle, planes), _variance(ground, across)
    slope = np.asarray(np.linalg.inv(ground_jacobian(camera, ground, _DIFFERENCE)), float)
    scale = pixel_height[measured] / located.height[measured]
    return _RawDisagreement(view, len(others), confirmed, middle, planes, field, variance, scale, slope)


def _on_planes(ground: Floats, middle: Floats, planes: Floats) -> Floats:
    """Values of planes at places (n, 2), float64 (n, column)."""
    return np.asarray(np.column_stack([np.ones(len(ground)), ground - middle]) @ planes)


def _variance(ground: Floats, across: Floats) -> Floats:
    """Variance of smoothed rows (n, 3), by rising frame, float64 (n, 3), square metres.

    The jackknife over spans of time (Efron and Stein 1981): rows of one person are not independent.
    """
    kept = [spans(len(ground)) != span for span in range(SPANS)]
    fields = [_on_planes(ground, *_smooth(ground[rows], across[rows])) for rows in kept]
    return np.asarray((SPANS - 1) * np.var(fields, axis=0))


def _smooth(ground: Floats, across: Floats) -> tuple[Floats, Floats]:
    """Least absolute deviations planes (by reweighting) of middles, heads and feet (n, 3), nan where unknown."""
    middle = np.median(ground, axis=0)
    basis = np.column_stack([np.ones(len(ground)), ground - middle])
    found = np.zeros((3, across.shape[1]))
    for column in range(across.shape[1]):
        measured = np.isfinite(across[:, column])
        if not measured.any():
            continue
        rows, value, weight = basis[measured], across[measured, column], np.ones(int(measured.sum()))
        for _ in range(_ROUNDS):
            normal = (rows * weight[:, None]).T @ rows + np.diag([0.0, 1e-3, 1e-3])
            found[:, column] = np.linalg.solve(normal, (rows * weight[:, None]).T @ value)
            rest = value - rows @ found[:, column]
            weight = np.where(rest < 0, _ABOVE_WEIGHT[column], 1.0) / np.maximum(np.abs(rest), 0.01)
    return middle, found


def _size(moves: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(moves**2, axis=1))))


@dataclass(frozen=True)
class Verdict:
    """Displaced views of a rig."""

    views: tuple[Disagreement | None, ...]
    """Disagreement of each view, in the rig's order; None where people are too few."""
    named: tuple[Disagreement, ...]
    """Displaced views, the worst first."""
    unresolved: tuple[Disagreement, Disagreement] | None
    """Two views that disagree where there is no third to decide."""


def judge(rig: Rig, tables: Sequence[BodyTable], people: BoxCorrespondences) -> Verdict:
    """Find the views that are displaced by more than a cell."""
    first = current = _all_raw_disagreements(rig, tables, people)
    named: list[Disagreement] = []
    while len(_judged(current)) > 2 and _worst(current) > rig.grid.cell and len(named) < len(rig.cameras) - 2:
        unnamed = [one for one in _judged(current) if one.view not in {other.view for other in named}]
        suspects = sorted(unnamed, key=lambda one: -one.off)[:_SUSPECTS]
        trials = []
        for suspect in suspects:
            corrected = _corrected(people, tables[suspect.view], current[suspect.view])
            after = _all_raw_disagreements(rig, tables, corrected)
            spread = float(np.sqrt(np.mean([one.off**2 for one in _judged(after)])))  # root mean square over the views
            trials.append((spread, suspect, corrected, after))
        if not trials:
            break
        _, worst, people, current = min(trials, key=lambda trial: trial[0])
        if worst.certainly_off <= rig.grid.cell:
            break
        named.append(worst)
    whole = _judged(first)
    unresolved = (whole[0], whole[1]) if len(whole) == 2 and _worst(first) > rig.grid.cell else None
    return Verdict(tuple(_without_shared(first)), tuple(named), unresolved)


def _all_raw_disagreements(
    rig: Rig, tables: Sequence[BodyTable], people: BoxCorrespondences
) -> list[_RawDisagreement | None]:
    views = range(len(rig.cameras))
    return [
        _raw_disagreement(rig.cameras[view], tables, people, view, [o for o in views if o != view]) for view in views
    ]


def _without_shared(raw: Sequence[_RawDisagreement | None]) -> list[Disagreement | None]:
    """Disagreements without the common component, which needs three views or more."""
    means = [one.mean for one in raw if one is not None]
    shared = _common(np.array(means)) if len(means) > 2 else np.zeros(3)
    return [None if one is None else one.without(shared) for one in raw]


def _common(means: Floats) -> Floats:
    """Common component of rows (n, 3): medians of heads and feet, which differ between boxes and bodies.

    Sideways, the smallest value where all have one sign: two cameras that face each other share a displacement.
    """
    right = means[:, 0]
    shared = np.median(means, axis=0)
    shared[0] = np.abs(right).min() * np.sign(right[0]) if np.abs(np.sign(right).sum()) == len(right) else 0.0
    return np.asarray(shared)


def _judged(raw: Sequence[_RawDisagreement | None]) -> list[Disagreement]:
    return [one for one in _without_shared(raw) if one is not None]


def _corrected(people: BoxCorrespondences, table: BodyTable, raw: _RawDisagreement | None) -> BoxCorrespondences:
    """The correspondences with one view's disagreement removed from its boxes."""
    if raw is None:
        return people
    body = table.boxes_of(people.ground, people.height)
    scale = (body[:, 3] - body[:, 1]) / people.height
    right, head, feet = (_on_planes(people.ground, raw.middle, raw.planes) * scale[:, None]).T
    box = people.box.copy()
    box[:, raw.view] -= np.stack([right, head, right, feet], -1)
    return replace(people, box=box)


def _worst(raw: Sequence[_RawDisagreement | None]) -> float:
    return max((one.certainly_off for one in _judged(raw)), default=0.0)
