"""Appearance of each detected person in each view: features of the detector's box, or colours of trunk and legs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Bytes, Flags, Floats, Observation, Rows, Singles, ViewEvidence
from stseg.geometry.bodies import BodyTable
from stseg.model.people import Explanation
from stseg.model.tables import APPEARANCE, FEATURES

_APART = 0.5
"""Share of a body that a view must see."""
_FOREGROUND = 0.5
"""Least likelihood of a pixel whose colour counts."""
_SLICES = ((0.17, 0.5), (0.5, 0.95))
"""Trunk and legs: from and to, as shares of the body's extent in the image, from the head down."""
_LEAST_PIXELS = 8
"""Least pixels of the raster in each of them."""
_DARK = 16.0
"""Grey levels added to a colour before its logarithm is taken: noise of dark pixels says little."""


def appearance_rows(
    frame: int, explanation: Explanation, tables: Sequence[BodyTable], axes: Floats | None,
    observations: Sequence[Observation], evidence: Sequence[ViewEvidence],
) -> Rows:  # fmt: skip
    """APPEARANCE rows of a frame: for each view and person that it sees apart from others.

    Parameters
    ----------
    frame
    explanation
        The frame's people.
    tables
        Projected bodies of each view.
    axes : float64 (feature, FEATURES), or None
        By which features of boxes are reduced (`stseg.model.principal_axes`); None to leave them out.
    observations, evidence
        Of each view, in the rig's order.
    """
    parts = []
    for k, (seen, likely) in enumerate(zip(observations, evidence, strict=True)):
        apart = explanation.people.visibility[k] >= _APART
        rows = np.zeros(len(apart), APPEARANCE)
        rows["frame"], rows["view"] = frame, k
        rows["x"], rows["y"] = explanation.people.ground.T
        rows["features"], rows["colours"] = np.nan, np.nan
        if isinstance(likely, Boxes) and likely.features is not None and axes is not None:
            owner = explanation.box_assignment[k]
            reduced = likely.features[owner >= 0] @ axes
            rows["features"][owner[owner >= 0]] = np.pad(reduced, ((0, 0), (0, FEATURES - axes.shape[1])))
        elif isinstance(likely, np.ndarray) and isinstance(seen, np.ndarray) and seen.ndim == 3:
            image = np.asarray(seen, np.uint8)
            rows["colours"] = _colours(explanation, k, tables[k], apart, image, likely)
        known = np.isfinite(rows["features"]).any(axis=1) | np.isfinite(rows["colours"]).all(axis=1)
        parts.append(rows[apart & known])
    return np.concatenate([np.zeros(0, APPEARANCE), *parts])


def _colours(
    explanation: Explanation, view: int, table: BodyTable, apart: Flags, image: Bytes, likelihood: Singles
) -> Singles:
    """Mean logarithms of blue, green and red of trunk and legs of each person (n, 6); nan where too little is seen.

    A gain of the camera adds the same to all of them.
    """
    people, step = explanation.people, explanation.raster_step[view]
    found = np.full((len(people), len(_SLICES), 3), np.nan, np.float32)
    assigned = explanation.pixel_assignment[view]
    v, u = np.nonzero(assigned >= 0)
    person = assigned[v, u].astype(np.int64)
    row, column = (np.minimum(at * step + step // 2, size - 1) for at, size in zip((v, u), image.shape, strict=False))
    kept = apart[person] & (likelihood[row, column] > _FOREGROUND)
    person, row, column = person[kept], row[kept], column[kept]
    box = table.boxes_of(people.ground, people.height)
    with np.errstate(invalid="ignore", divide="ignore"):
        down = (row - box[person, 1]) / (box[person, 3] - box[person, 1])
    colour = np.log(image[row, column] + _DARK)
    for s, (start, stop) in enumerate(_SLICES):
        inside = (down >= start) & (down < stop)
        count = np.bincount(person[inside], minlength=len(people))
        enough = count >= _LEAST_PIXELS
        for channel in range(3):
            total = np.bincount(person[inside], colour[inside, channel], len(people))
            found[enough, s, channel] = total[enough] / count[enough]
    return found.reshape(len(people), len(_SLICES) * 3)
