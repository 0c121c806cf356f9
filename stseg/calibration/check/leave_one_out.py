"""Leave-one-out residuals: boxes of one view against people located by the other views.

Ground point and height of a person are a robust least-squares fit (Cauchy loss) to the middle, upper and lower edges of
its boxes, in standard deviations of a box's edges. Residuals in the view that was left out are metres at the person,
across the viewing ray, so that near and far views are comparable.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stseg.arrays import Flags, Floats
from stseg.bodies.pillars import BodyTable
from stseg.calibration.check.box_correspondence import BoxCorrespondences
from stseg.geometry.rig import BODY_HEIGHT

_EDGE_SPREAD, _PIXEL_SPREAD = (0.06, 0.045, 0.06), 2.0
"""Standard deviations of a box's middle, upper and lower edge as shares of the body's height, and pixels added to each
(a detector's grid, a blob's fringe)."""
_HEIGHT_SPREAD = 0.15  # metres, around `BODY_HEIGHT`
_ROUNDS = 6
_DIFFERENCE = 0.02
"""Step of the finite differences, metres."""


def locate(
    people: BoxCorrespondences, tables: Sequence[BodyTable], views: Sequence[int], least: int
) -> BoxCorrespondences:
    """People located from the given views: ground and height are nan where fewer than `least` have a box of them."""
    ground, height = people.ground.copy(), np.clip(people.height, 1.4, 2.0)
    boxes = people.box[:, list(views)]
    chosen = [tables[view] for view in views]
    enough = np.isfinite(boxes[..., 0]).sum(axis=1) >= least
    for _ in range(_ROUNDS):
        estimate = np.column_stack([ground, height])
        residual = _edge_residuals(chosen, boxes, estimate)
        slope = np.stack(
            [
                (_edge_residuals(chosen, boxes, estimate + move) - _edge_residuals(chosen, boxes, estimate - move))
                / (2 * _DIFFERENCE)
                for move in _DIFFERENCE * np.eye(3)
            ],
            -1,
        )
        weight = np.where(
            np.isfinite(residual) & np.isfinite(slope).all(-1), 1 / (1 + np.nan_to_num(residual) ** 2 / 4), 0.0
        )
        residual, slope = np.nan_to_num(residual), np.nan_to_num(slope)
        normal = np.einsum("nk,nka,nkb->nab", weight, slope, slope) + 1e-6 * np.eye(3)
        normal[:, 2, 2] += 1 / _HEIGHT_SPREAD**2
        push = np.einsum("nk,nka,nk->na", weight, slope, residual)
        push[:, 2] += (height - BODY_HEIGHT) / _HEIGHT_SPREAD**2
        step = np.clip(-np.linalg.solve(normal, push[..., None])[..., 0], -0.5, 0.5)
        ground, height = ground + step[:, :2], np.clip(height + step[:, 2], 1.2, 2.2)
    return replace(people, ground=np.where(enough[:, None], ground, np.nan), height=np.where(enough, height, np.nan))


def _edge_residuals(tables: Sequence[BodyTable], boxes: Floats, people: Floats) -> Floats:
    """Normalised residuals of middle, upper and lower edges in all views, float64 (n, 3 view); nan where unknown."""
    parts = []
    for k, table in enumerate(tables):
        residual, uncut, pixel_height = edge_residuals(table, people[:, :2], people[:, 2], boxes[:, k])
        spread = np.stack([share * pixel_height for share in _EDGE_SPREAD], -1) + _PIXEL_SPREAD
        parts.append(np.where(uncut, residual / spread, np.nan))
    return np.concatenate(parts, axis=1)


def edge_residuals(table: BodyTable, ground: Floats, height: Floats, box: Floats) -> tuple[Floats, Flags, Floats]:
    """Residuals of boxes against predicted bodies in one view.

    Parameters
    ----------
    ground : float64 (n, 2), height : float64 (n,)
        Metres.
    box : float64 (n, 4)
        left, top, right, bottom, pixels.

    Returns
    -------
    residual : float64 (n, 3)
        Box minus body, pixels: middle (right positive), upper edge and lower edge (down positive).
    known : bool (n, 3)
        Where the image's border cuts neither box nor body.
    pixel_height : float64 (n,)
        Height of the body, pixels.
    """
    body = table.boxes_of(ground, height)
    width, rows = table.size
    with np.errstate(invalid="ignore"):
        middle = box[:, [0, 2]].mean(1) - body[:, [0, 2]].mean(1)
        residual = np.stack([middle, box[:, 1] - body[:, 1], box[:, 3] - body[:, 3]], -1)
        sides = (np.minimum(box[:, 0], body[:, 0]) > 1) & (np.maximum(box[:, 2], body[:, 2]) < width - 2)
        head = np.minimum(box[:, 1], body[:, 1]) > 1
        feet = np.maximum(box[:, 3], body[:, 3]) < rows - 2
    uncut = np.stack([sides, head, feet], -1) & np.isfinite(residual)
    return residual, uncut, body[:, 3] - body[:, 1]
