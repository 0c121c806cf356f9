"""Boxes of tracks in each view, around the body's localisation on all planes (Khan and Shah 2009, section 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.bodies.pillars import BodyTable
from stseg.records.tables import BOX


def box_rows(tables: Sequence[BodyTable], trajectory: Rows) -> Rows:
    """BOX rows of a TRAJECTORY, clipped to the images; none where a view does not see the body.

    Sorted by frame, then id, then view, as the trajectory is.
    """
    rows = []
    ground = np.column_stack([trajectory["x"], trajectory["y"]])
    for view, table in enumerate(tables):
        width, height = table.size
        edges = table.boxes_of(ground, trajectory["height"].astype(float)).clip(0, [width, height] * 2)
        visible = (edges[:, 2] > edges[:, 0]) & (edges[:, 3] > edges[:, 1])
        boxes = np.zeros(int(visible.sum()), BOX)
        boxes["frame"], boxes["id"], boxes["view"] = trajectory["frame"][visible], trajectory["id"][visible], view
        boxes["left"], boxes["top"] = edges[visible, 0], edges[visible, 1]
        boxes["width"], boxes["height"] = (edges[visible, 2:] - edges[visible, :2]).T
        rows.append(boxes)
    joined = np.concatenate(rows)
    return joined[np.lexsort((joined["view"], joined["id"], joined["frame"]))]
