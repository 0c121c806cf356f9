"""Correspondence of boxes between views: people on the ground, and the box of each in every view.

Every box proposes a ground point: under its feet or, since these may be hidden, under its head at `BODY_HEIGHT`. Each
candidate is compared with the boxes of the other views, and candidates are selected greedily by the number and quality
of confirmations. Gates are wide (half a metre), so that a displaced view still takes part.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import Boxes, Flags, Floats, Ints, Singles
from stseg.bodies.pillars import BodyTable
from stseg.calibration.automatic.endpoints import SILHOUETTE_LIKELIHOOD
from stseg.geometry import Camera, Grid, Rig
from stseg.geometry.fits import homogeneous
from stseg.geometry.rig import BODY_HEIGHT

_MIN_HEIGHT, _MAX_HEIGHT = 1.35, 2.10
_MATCH_GATE = 0.35
"""Association gate: distance of a box's middle and top from the body's, in body heights (about 0.6 m)."""
_OCCLUSION = 0.6
"""Share of a body's height that may be hidden at the feet."""
_MIN_WIDTH, _MAX_WIDTH = 0.4, 2.0
"""Least and greatest width of a single person's box, in body widths."""
_BORDER = 2.0
"""Distance from the image border within which a box counts as cut, pixels."""
SPANS = 8
"""Spans of time that are left out in turn: the errors of one person, and what hides them, last for a while."""
_MARGIN = 0.5
"""Margin around the area in which candidates are kept, metres."""


@dataclass(frozen=True)
class BoxCorrespondences:
    """People of some frames with the box of each in every view."""

    frame: Ints
    """int64 (n,)."""
    ground: Floats
    """float64 (n, 2): metres."""
    height: Floats
    """float64 (n,): metres."""
    box: Floats
    """float64 (n, view, 4): left, top, right, bottom in pixels; nan where a view has no box of the person."""

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def has_box(self) -> Flags:
        """Whether each view has a box of each person, bool (n, view)."""
        return np.asarray(np.isfinite(self.box[..., 0]))

    def without_span(self, span: int) -> "BoxCorrespondences":
        """The people without those of one of `SPANS`."""
        rows = spans(len(self)) != span
        return BoxCorrespondences(self.frame[rows], self.ground[rows], self.height[rows], self.box[rows])


def spans(rows: int) -> Ints:
    """Span of time of each row, by rising frame, int64 (rows,)."""
    return np.arange(rows) * SPANS // max(rows, 1)


def tables_of(rig: Rig) -> list[BodyTable]:
    """Body tables of all views, with a margin around the grid."""
    return [BodyTable.of(camera, rig.grid, margin=1.5) for camera in rig.cameras]


def match_boxes(rig: Rig, tables: Sequence[BodyTable], frame: int, boxes: Sequence[Floats]) -> BoxCorrespondences:
    """Match the boxes of one frame between views; people seen by at least two are kept.

    `tables` are those of `tables_of`; boxes float64 (b, 4) of each view are left, top, right, bottom in pixels.
    """
    found = [candidates(camera, rig.grid, part) for camera, part in zip(rig.cameras, boxes, strict=True)]
    ground, height, _ = (np.concatenate(column) for column in zip(*found, strict=True))
    views = len(boxes)
    residual, which = np.full((len(ground), views), np.inf), np.full((len(ground), views), -1)
    for view, (table, view_boxes) in enumerate(zip(tables, boxes, strict=True)):
        if len(view_boxes) and len(ground):
            distance = mismatch(table, ground, height, view_boxes)
            which[:, view], residual[:, view] = distance.argmin(axis=1), distance.min(axis=1)
    selected = _greedy_selection(residual, which)
    box = np.full((len(selected), views, 4), np.nan)
    for row, (candidate, confirmed) in enumerate(selected):
        for view in confirmed.tolist():
            box[row, view] = boxes[view][which[candidate, view]]
    chosen = np.array([candidate for candidate, _ in selected], np.int64)
    return BoxCorrespondences(np.full(len(selected), frame, np.int64), ground[chosen], height[chosen], box)


def mismatch(table: BodyTable, ground: Floats, height: Floats, boxes: Floats) -> Floats:
    """Distance between boxes and bodies in one view, in gates, infinite from 1 on, float64 (n, b).

    Ground float64 (n, 2) and height float64 (n,) are in metres, boxes float64 (b, 4) in pixels.
    """
    body = table.boxes_of(ground, height)
    pixel_height = (body[:, 3] - body[:, 1])[:, None]
    wide = (body[:, 2] - body[:, 0])[:, None]
    with np.errstate(invalid="ignore"):
        middle = np.abs(body[:, None, [0, 2]].mean(-1) - boxes[None, :, [0, 2]].mean(-1)) / pixel_height
        top = np.abs(body[:, None, 1] - boxes[None, :, 1]) / pixel_height
        early = (body[:, None, 3] - boxes[None, :, 3]) / pixel_height
        widths = (boxes[:, 2] - boxes[:, 0])[None] / wide
        off = np.hypot(middle, top) / _MATCH_GATE
        fits = (off < 1) & (early < _OCCLUSION) & (early > -_MATCH_GATE) & (widths > _MIN_WIDTH) & (widths < _MAX_WIDTH)
        # Head and sides are inside the image.
        inside = (body[:, :2] > 0).all(axis=1) & (body[:, 2] < table.size[0] - 1) & (body[:, 1] < table.size[1] - 1)
    return np.where(fits & inside[:, None], off, np.inf)


def wholly_visible(table: BodyTable, ground: Floats, height: Floats) -> Flags:
    """Whether a body is wholly inside a view's image, bool (n,)."""
    body = table.boxes_of(ground, height)
    with np.errstate(invalid="ignore"):
        return np.asarray((body[:, :2] > 1).all(axis=1) & (body[:, 2:] < np.array(table.size) - 2).all(axis=1))


def candidates(camera: Camera, grid: Grid, boxes: Floats) -> tuple[Floats, Floats, Ints]:
    """Where people may stand of whom a view has these boxes.

    Parameters
    ----------
    boxes : float64 (b, 4)
        left, top, right, bottom, pixels.

    Returns
    -------
    ground : float64 (n, 2), height : float64 (n,)
        Metres.
    box : int64 (n,)
        Index of the box, of which some have two candidates and others none.
    """
    middle = boxes[:, [0, 2]].mean(axis=1)
    whole = boxes[:, 3] < camera.size[1] - 1 - _BORDER
    foot = camera.back_project(np.stack([middle, boxes[:, 3]], -1))
    by_head = camera.back_project(np.stack([middle, boxes[:, 1]], -1), BODY_HEIGHT)
    ground = np.concatenate([foot, by_head])
    height = np.where(whole, height_of(camera, foot, middle, boxes[:, 1]), np.nan)
    height = np.concatenate([height, np.full(len(boxes), BODY_HEIGHT)])
    low, high = np.transpose([grid.x, grid.y])
    with np.errstate(invalid="ignore"):
        in_area = ((ground > low - _MARGIN) & (ground < high + _MARGIN)).all(axis=1)
        kept = (height > _MIN_HEIGHT) & (height < _MAX_HEIGHT) & in_area
    return ground[kept], height[kept], np.flatnonzero(kept) % max(len(boxes), 1)


def height_of(camera: Camera, ground: Floats, u: Floats, top: Floats) -> Floats:
    """Height of a person at a ground point with the head at row `top`, metres, float64 (n,)."""
    ideal = camera.ideal(np.stack([u, top], -1))
    foot = homogeneous(ground) @ camera.ground.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(
            (foot[:, 1] - ideal[:, 1] * foot[:, 2]) / (ideal[:, 1] * camera.vertical[2] - camera.vertical[1])
        )


def _greedy_selection(residual: Floats, which: Ints) -> list[tuple[int, Ints]]:
    """Greedy selection of candidates, the best confirmed first, with the views that confirm each; no box twice."""
    score = np.where(residual < 1, 1 - np.minimum(residual, 1) ** 2, 0.0)
    selected: list[tuple[int, Ints]] = []
    while True:
        total = np.where((score > 0).sum(axis=1) > 1, score.sum(axis=1), 0.0)
        if not total.any():
            return selected
        best = int(total.argmax())
        confirmed = np.flatnonzero(score[best] > 0)
        selected.append((best, confirmed))
        for view in confirmed.tolist():
            score[which[:, view] == which[best, view], view] = 0
        score[best] = 0


_MIN_AREA = 0.0006
"""Least area of a blob, share of the image's area."""
_MIN_FILL = 0.25
"""Least share of its bounding box that a blob fills."""


def isolated_boxes(evidence: Boxes | Singles | None, size: tuple[int, int]) -> Floats:
    """Boxes of one view and frame: left, top, right, bottom in pixels, float64 (n, 4).

    The evidence is boxes, a likelihood map float32 (v, u), or None where the view is blind; `size` is the width and
    height of the image, pixels.
    """
    if evidence is None:
        return np.zeros((0, 4))
    if isinstance(evidence, Boxes):
        return np.concatenate([evidence.pixel[:, :2], evidence.pixel[:, :2] + evidence.pixel[:, 2:]], axis=1)
    blobs = cv2.connectedComponentsWithStats((evidence > SILHOUETTE_LIKELIHOOD).view(np.uint8))[2][1:]
    left, top, width, height, area = blobs.T
    is_solid = (area > _MIN_AREA * size[0] * size[1]) & (area > _MIN_FILL * width * height)
    return np.asarray(np.stack([left, top, left + width, top + height], axis=1)[is_solid] - 0.5)
