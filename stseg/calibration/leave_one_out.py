"""Where each view alone would put people, against where the others put them (leave one out).

A person's place and height are least squares over boxes: middle, upper and lower edge, in standard deviations of what
a box can tell (as in `ghosts.boxes`), Cauchy loss. What is left in the view that was left out is measured in metres at
the person across the line of sight, so that near and far, high and flat views speak alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats
from stseg.calibration.box_correspondence import Bystanders
from stseg.geometry.bodies import BodyTable

_SIDE, _HEAD, _FEET, _PIXELS = 0.06, 0.045, 0.06, 2.0
"""Standard deviations of a box's middle, upper and lower edge as shares of the body's height, and what is added to each
in pixels (a detector's grid, a blob's fringe)."""
_HEIGHT, _HEIGHT_SPREAD = 1.70, 0.15
_ROUNDS = 6
_STEP = 0.02
"""Metres, of differences."""


@dataclass(frozen=True)
class Placed:
    """Where people stand by some of the views.

    Attributes
    ----------
    ground : float64 (n, 2)
        Metres; nan where too few views say it.
    height : float64 (n,)
        Metres.
    """

    ground: Floats
    height: Floats


def place(people: Bystanders, tables: Sequence[BodyTable], asked: Sequence[int], least: int) -> Placed:
    """Where people stand by the views that are asked, where at least `least` of them show the person."""
    ground, height = people.ground.copy(), np.clip(people.height, 1.4, 2.0)
    boxes = people.box[:, list(asked)]
    chosen = [tables[view] for view in asked]
    enough = np.isfinite(boxes[..., 0]).sum(axis=1) >= least
    for _ in range(_ROUNDS):
        here = np.column_stack([ground, height])
        miss = _misses(chosen, boxes, here)
        slope = np.stack(
            [
                (_misses(chosen, boxes, here + move) - _misses(chosen, boxes, here - move)) / (2 * _STEP)
                for move in _STEP * np.eye(3)
            ],
            -1,
        )
        weight = np.where(np.isfinite(miss) & np.isfinite(slope).all(-1), 1 / (1 + np.nan_to_num(miss) ** 2 / 4), 0.0)
        miss, slope = np.nan_to_num(miss), np.nan_to_num(slope)
        normal = np.einsum("nk,nka,nkb->nab", weight, slope, slope) + 1e-6 * np.eye(3)
        normal[:, 2, 2] += 1 / _HEIGHT_SPREAD**2
        push = np.einsum("nk,nka,nk->na", weight, slope, miss)
        push[:, 2] += (height - _HEIGHT) / _HEIGHT_SPREAD**2
        step = np.clip(-np.linalg.solve(normal, push[..., None])[..., 0], -0.5, 0.5)
        ground, height = ground + step[:, :2], np.clip(height + step[:, 2], 1.2, 2.2)
    return Placed(np.where(enough[:, None], ground, np.nan), np.where(enough, height, np.nan))


def _misses(tables: Sequence[BodyTable], boxes: Floats, here: Floats) -> Floats:
    """Middle, upper and lower edges of all views in standard deviations, float64 (n, 3 view); nan where unknown."""
    parts = []
    for k, table in enumerate(tables):
        miss, known, tall = edges(table, here[:, :2], here[:, 2], boxes[:, k])
        spread = np.stack([_SIDE * tall, _HEAD * tall, _FEET * tall], -1) + _PIXELS
        parts.append(np.where(known, miss / spread, np.nan))
    return np.concatenate(parts, axis=1)


def edges(table: BodyTable, ground: Floats, height: Floats, box: Floats) -> tuple[Floats, Flags, Floats]:
    """What boxes show beside what people would, in one view.

    Parameters
    ----------
    table
    ground : float64 (n, 2), height : float64 (n,)
        Metres.
    box : float64 (n, 4)
        left, top, right, bottom, pixels.

    Returns
    -------
    miss : float64 (n, 3)
        Middle to the right, upper edge and lower edge downwards, box less body, pixels.
    known : bool (n, 3)
        Where the image's border cuts neither.
    tall : float64 (n,)
        The body's height in pixels.
    """
    body = table.boxes_of(ground, height)
    width, rows = table.size
    with np.errstate(invalid="ignore"):
        middle = box[:, [0, 2]].mean(1) - body[:, [0, 2]].mean(1)
        miss = np.stack([middle, box[:, 1] - body[:, 1], box[:, 3] - body[:, 3]], -1)
        sides = (np.minimum(box[:, 0], body[:, 0]) > 1) & (np.maximum(box[:, 2], body[:, 2]) < width - 2)
        head = np.minimum(box[:, 1], body[:, 1]) > 1
        feet = np.maximum(box[:, 3], body[:, 3]) < rows - 2
    known = np.stack([sides, head, feet], -1) & np.isfinite(miss)
    return miss, known, body[:, 3] - body[:, 1]
