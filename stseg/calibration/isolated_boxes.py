"""Boxes of what may be single people, from whatever a view shows: boxes, or blobs of a likelihood map."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from stseg.arrays import Boxes, Floats, Singles

_FOREGROUND = 0.8
"""Likelihood from which on a pixel belongs to a blob."""
_LEAST = 0.0006
"""Of the image's area: smaller blobs are noise."""
_FULL = 0.25
"""Of its box a body's blob fills more than this."""


def sightings(evidence: Boxes | Singles | None, size: tuple[int, int]) -> Floats:
    """Boxes that one view shows in one frame.

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
    labels, count = ndimage.label(evidence > _FOREGROUND, np.ones((3, 3)))
    found = []
    areas = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    for area, place in zip(areas.tolist(), ndimage.find_objects(labels), strict=True):
        rows, columns = place
        box = (columns.start - 0.5, rows.start - 0.5, columns.stop - 0.5, rows.stop - 0.5)
        whole = (box[2] - box[0]) * (box[3] - box[1])
        if area > _LEAST * size[0] * size[1] and area > _FULL * whole:
            found.append(box)
    return np.array(found, float).reshape(-1, 4)
