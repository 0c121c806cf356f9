"""Boxes of possible single people in one view: a detector's boxes, or bounding boxes of foreground blobs."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from stseg.arrays import Boxes, Floats, Singles

_MIN_LIKELIHOOD = 0.8
"""Least foreground likelihood of a blob's pixels."""
_MIN_AREA = 0.0006
"""Least area of a blob, share of the image's area."""
_MIN_FILL = 0.25
"""Least share of its bounding box that a blob fills."""


def isolated_boxes(evidence: Boxes | Singles | None, size: tuple[int, int]) -> Floats:
    """Boxes of one view and frame.

    Parameters
    ----------
    evidence
        Boxes, a likelihood map float32 (v, u), or None where the view is blind.
    size
        Width and height of the image, pixels.

    Returns
    -------
    float64 (n, 4)
        left, top, right, bottom, pixels.
    """
    if evidence is None:
        return np.zeros((0, 4))
    if isinstance(evidence, Boxes):
        return np.concatenate([evidence.pixel[:, :2], evidence.pixel[:, :2] + evidence.pixel[:, 2:]], axis=1)
    labels, count = ndimage.label(evidence > _MIN_LIKELIHOOD, np.ones((3, 3)))
    found = []
    areas = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    for area, window in zip(areas.tolist(), ndimage.find_objects(labels), strict=True):
        rows, columns = window
        box = (columns.start - 0.5, rows.start - 0.5, columns.stop - 0.5, rows.stop - 0.5)
        whole = (box[2] - box[0]) * (box[3] - box[1])
        if area > _MIN_AREA * size[0] * size[1] and area > _MIN_FILL * whole:
            found.append(box)
    return np.array(found, float).reshape(-1, 4)
