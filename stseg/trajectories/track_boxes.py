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
        seen = (edges[:, 2] > edges[:, 0]) & (edges[:, 3] > edges[:, 1])
        own = np.zeros(int(seen.sum()), BOX)
        own["frame"], own["id"], own["view"] = trajectory["frame"][seen], trajectory["id"][seen], view
        own["left"], own["top"] = edges[seen, 0], edges[seen, 1]
        own["width"], own["height"] = (edges[seen, 2:] - edges[seen, :2]).T
        rows.append(own)
    every = np.concatenate(rows)
    return every[np.lexsort((every["view"], every["id"], every["frame"]))]
