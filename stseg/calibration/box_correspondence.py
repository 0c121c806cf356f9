"""People whom several views show, found from their boxes alone: who stands where, and which box of each view is whom.

Every box says where its person would stand: by its feet, or, where these may be hidden, by its head at the height of
most people. Each such place is held against the boxes of the other views; the places that most views confirm are taken
one after the other, each with its boxes. Gates are wide (half a metre), so that a view that is off still takes part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.geometry import Camera, Grid, Rig
from stseg.geometry.bodies import BodyTable

_COMMON = 1.70
"""Metres: how tall most people are, about."""
_SHORTEST, _TALLEST = 1.35, 2.10
GATE = 0.35
"""Of a body's height, by which middle and top of its box may be off: 0.6 m."""
_HIDDEN = 0.6
"""Of a body's height that may be hidden at the feet."""
_WIDTHS = (0.4, 2.0)
"""Widths of a single person's box, in widths of a body's."""
_BORDER = 2.0
"""Pixels: a box that ends so near the border is cut by it."""
_MARGIN = 0.5
"""Metres around the area in which people are sought."""


@dataclass(frozen=True)
class Bystanders:
    """People of some frames and what each view shows of them.

    Attributes
    ----------
    frame : int64 (n,)
    ground : float64 (n, 2)
        Metres.
    height : float64 (n,)
        Metres.
    box : float64 (n, view, 4)
        left, top, right, bottom in pixels; nan where a view shows no box of the person.
    """

    frame: Ints
    ground: Floats
    height: Floats
    box: Floats

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def seen(self) -> Flags:
        """Whom each view shows, bool (n, view)."""
        return np.asarray(np.isfinite(self.box[..., 0]))


def tables_of(rig: Rig) -> list[BodyTable]:
    """The body tables of all views, wide enough for what this package asks."""
    return [BodyTable.of(camera, rig.grid, margin=1.5) for camera in rig.cameras]


def find_bystanders(rig: Rig, tables: Sequence[BodyTable], frame: int, boxes: Sequence[Floats]) -> Bystanders:
    """The people of one frame whom at least two views show.

    Parameters
    ----------
    rig
    tables
        See `tables_of`.
    frame
        Its number.
    boxes
        For each view float64 (b, 4), left, top, right, bottom in pixels.
    """
    ground, height = _places(rig, boxes)
    views = len(boxes)
    miss, which = np.full((len(ground), views), np.inf), np.full((len(ground), views), -1)
    for view, (table, own) in enumerate(zip(tables, boxes, strict=True)):
        if len(own) and len(ground):
            apart = mismatch(table, ground, height, own)
            which[:, view], miss[:, view] = apart.argmin(axis=1), apart.min(axis=1)
    taken = _greedy(miss, which)
    box = np.full((len(taken), views, 4), np.nan)
    for row, (place, confirmed) in enumerate(taken):
        for view in confirmed.tolist():
            box[row, view] = boxes[view][which[place, view]]
    chosen = np.array([place for place, _ in taken], np.int64)
    return Bystanders(np.full(len(taken), frame, np.int64), ground[chosen], height[chosen], box)


def joined(found: Sequence[Bystanders]) -> Bystanders:
    """The people of several frames, at least one frame."""
    parts = [(one.frame, one.ground, one.height, one.box) for one in found]
    return Bystanders(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def mismatch(table: BodyTable, ground: Floats, height: Floats, boxes: Floats) -> Floats:
    """How badly boxes fit people in one view, in gates; infinite from 1 on.

    Parameters
    ----------
    table
        The view.
    ground : float64 (n, 2), height : float64 (n,)
        Metres.
    boxes : float64 (b, 4)
        Pixels.

    Returns
    -------
    float64 (n, b)
    """
    body = table.boxes_of(ground, height)
    tall = (body[:, 3] - body[:, 1])[:, None]
    wide = (body[:, 2] - body[:, 0])[:, None]
    with np.errstate(invalid="ignore"):
        middle = np.abs(body[:, None, [0, 2]].mean(-1) - boxes[None, :, [0, 2]].mean(-1)) / tall
        top = np.abs(body[:, None, 1] - boxes[None, :, 1]) / tall
        early = (body[:, None, 3] - boxes[None, :, 3]) / tall
        widths = (boxes[:, 2] - boxes[:, 0])[None] / wide
        off = np.hypot(middle, top) / GATE
        fits = (off < 1) & (early < _HIDDEN) & (early > -GATE) & (widths > _WIDTHS[0]) & (widths < _WIDTHS[1])
    inside = _inside(body, table.size)[:, None]
    return np.where(fits & inside, off, np.inf)


def whole_in(table: BodyTable, ground: Floats, height: Floats) -> Flags:
    """People who are whole within a view's image, bool (n,)."""
    body = table.boxes_of(ground, height)
    with np.errstate(invalid="ignore"):
        return np.asarray((body[:, :2] > 1).all(axis=1) & (body[:, 2:] < np.array(table.size) - 2).all(axis=1))


def _inside(body: Floats, size: tuple[int, int]) -> Flags:
    """Bodies whose head and sides are within the image."""
    with np.errstate(invalid="ignore"):
        return np.asarray((body[:, 0] > 0) & (body[:, 2] < size[0] - 1) & (body[:, 1] > 0) & (body[:, 1] < size[1] - 1))


def _places(rig: Rig, boxes: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Where the boxes' people would stand and how tall they would be, float64 (n, 2) and (n,)."""
    grounds, heights = [np.zeros((0, 2))], [np.zeros(0)]
    for camera, own in zip(rig.cameras, boxes, strict=True):
        if not len(own):
            continue
        middle = own[:, [0, 2]].mean(axis=1)
        whole = own[:, 3] < camera.size[1] - 1 - _BORDER
        foot = camera.back_project(np.stack([middle, own[:, 3]], -1))
        height = np.where(whole, height_of(camera, foot, middle, own[:, 1]), np.nan)
        by_head = camera.back_project(np.stack([middle, own[:, 1]], -1), _COMMON)
        grounds += [foot, by_head]
        heights += [height, np.full(len(own), _COMMON)]
    ground, height = np.concatenate(grounds), np.concatenate(heights)
    with np.errstate(invalid="ignore"):
        kept = (height > _SHORTEST) & (height < _TALLEST) & _around(ground, rig.grid)
    return ground[kept], height[kept]


def height_of(camera: Camera, ground: Floats, u: Floats, top: Floats) -> Floats:
    """How tall somebody is whose head shows at row `top`, metres, float64 (n,)."""
    head = np.stack([u, top], -1)
    ideal = head if camera.lens is None else camera.lens.undistort(head)
    foot = np.concatenate([ground, np.ones((len(ground), 1))], 1) @ camera.ground.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(
            (foot[:, 1] - ideal[:, 1] * foot[:, 2]) / (ideal[:, 1] * camera.vertical[2] - camera.vertical[1])
        )


def _around(ground: Floats, grid: Grid) -> Flags:
    x, y = ground[:, 0], ground[:, 1]
    return np.asarray(
        (x > grid.x[0] - _MARGIN) & (x < grid.x[1] + _MARGIN) & (y > grid.y[0] - _MARGIN) & (y < grid.y[1] + _MARGIN)
    )


def _greedy(miss: Floats, which: Ints) -> list[tuple[int, Ints]]:
    """Places taken one after the other, those that the views confirm best first, and by which views; no box twice."""
    score = np.where(miss < 1, 1 - np.minimum(miss, 1) ** 2, 0.0)
    taken: list[tuple[int, Ints]] = []
    while True:
        total = np.where((score > 0).sum(axis=1) > 1, score.sum(axis=1), 0.0)
        if not total.any():
            return taken
        best = int(total.argmax())
        confirmed = np.flatnonzero(score[best] > 0)
        taken.append((best, confirmed))
        for view in confirmed.tolist():
            score[which[:, view] == which[best, view], view] = 0
        score[best] = 0
