"""Appearance of each detected person in each view: features of the detector's box, and colours of trunk and legs."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Boxes, Bytes, Flags, Floats, Ints, Observation, Rows, Singles, ViewEvidence
from stseg.bodies.pillars import BodyTable
from stseg.detection.problem import PixelAssignment
from stseg.kernels.accelerate import wide_kernel
from stseg.records.people import Explanation
from stseg.records.tables import APPEARANCE, FEATURES

_LEAST_FOUND_SHARE = 0.5
"""Least share of a whole body's detection rate in a view of boxes, for a row."""
_MINIMUM_FOREGROUND = 0.5
"""Least likelihood of foreground at which a pixel's colour counts."""
_SLICES = ((0.17, 0.5), (0.5, 0.95))
"""Trunk and legs: from and to, as shares of the body's extent in the image, from the head down."""
_MINIMUM_PIXELS = 8
"""Least pixels of the raster in each of them."""
_DARK_OFFSET = 16.0
"""Grey levels added to a colour before its logarithm is taken: noise of dark pixels says little."""
_LOGARITHM = np.log(np.arange(256) + _DARK_OFFSET)


def appearance_rows(
    frame: int,
    explanation: Explanation,
    tables: Sequence[BodyTable],
    axes: Floats | None,
    observations: Sequence[Observation],
    evidence: Sequence[ViewEvidence],
    images: Sequence[Observation] = (),
) -> Rows:
    """APPEARANCE rows of a frame: for each view and person that it sees past others.

    `explanation` holds the frame's people. Observations, evidence, and `tables` (projected bodies) are of each view, in
    the rig's order. `axes` float64 (feature, FEATURES) reduce the features of boxes (`stseg.records.principal_axes`);
    None leaves them out. `images` are the colour frames of views that deliver boxes: of each view, None where it has
    none; empty where none has.
    """
    parts = []
    pictures = images or [None] * len(observations)
    for k, (observation, likely, image) in enumerate(zip(observations, evidence, pictures, strict=True)):
        is_visible = explanation.people.found_share[k] >= _LEAST_FOUND_SHARE
        rows = np.zeros(len(is_visible), APPEARANCE)
        rows["frame"], rows["view"] = frame, k
        rows["x"], rows["y"] = explanation.people.ground.T
        rows["features"], rows["colours"] = np.nan, np.nan
        if isinstance(likely, Boxes) and likely.features is not None and axes is not None:
            owner = explanation.box_assignment[k]
            reduced = likely.features[owner >= 0] @ axes
            rows["features"][owner[owner >= 0]] = np.pad(reduced, ((0, 0), (0, FEATURES - axes.shape[1])))
        if isinstance(likely, Boxes) and isinstance(image, np.ndarray):
            middles = _middles(likely, explanation.box_assignment[k], image.shape[:2])
            rows["colours"] = _colours(explanation, k, tables[k], is_visible, np.asarray(image, np.uint8), middles)
        elif isinstance(likely, np.ndarray) and isinstance(observation, np.ndarray) and observation.ndim == 3:
            rows["colours"] = _colours(explanation, k, tables[k], is_visible, np.asarray(observation, np.uint8), likely)
        has_appearance = np.isfinite(rows["features"]).any(axis=1) | np.isfinite(rows["colours"]).all(axis=1)
        parts.append(rows[is_visible & has_appearance])
    return np.concatenate([np.zeros(0, APPEARANCE), *parts])


def _middles(boxes: Boxes, owner: Ints, shape: tuple[int, ...]) -> Singles:
    """Where the boxes of people show bodies: 1 in the middle half of their width, 0 elsewhere, float32 (v, u)."""
    body_mask = np.zeros(shape, np.float32)
    for left, top, width, height in boxes.pixel[owner >= 0].tolist():
        columns = slice(max(round(left + width / 4), 0), max(round(left + 3 * width / 4), 0))
        body_mask[max(round(top), 0) : max(round(top + height), 0), columns] = 1.0
    return body_mask


def _colours(
    explanation: Explanation, view: int, table: BodyTable, is_visible: Flags, image: Bytes, likelihood: Singles
) -> Singles:
    """Mean logarithms of blue, green and red of trunk and legs of each person (n, 6); nan where too little is seen.

    A gain of the camera adds the same to all of them.
    """
    people, step = explanation.people, explanation.raster_step[view]
    box = table.boxes_of(people.ground, people.height)
    total, count = np.zeros((len(people), len(_SLICES), 3)), np.zeros((len(people), len(_SLICES)), np.int64)
    _add_colours(explanation.pixel_assignment[view], step, is_visible, box, image, likelihood, total, count)
    enough = count >= _MINIMUM_PIXELS
    found = np.full(total.shape, np.nan, np.float32)
    found[enough] = total[enough] / count[enough][:, None]
    return found.reshape(len(people), len(_SLICES) * 3)


@wide_kernel
def _add_colours(
    assigned: PixelAssignment,
    step: int,
    is_visible: Flags,
    box: Floats,
    image: Bytes,
    likelihood: Singles,
    total: Floats,
    count: Ints,
) -> None:
    """Add the logarithms of colours to total (person, slice, channel), and their number to count (person, slice).

    Of each raster pixel that is assigned (v, u) to a visible person (person,) with a box (person, 4) is in pixels,
    the pixel in its middle counts.
    """
    for v in range(assigned.shape[0]):
        row, here, most = min(v * step + step // 2, image.shape[0] - 1), assigned[v], np.int16(-1)
        for u in range(len(here)):
            most = max(most, here[u])
        if most < 0:  # as in most rows of most views
            continue
        for u in range(len(here)):
            person = here[u]
            if person < 0 or not is_visible[person]:
                continue
            column = min(u * step + step // 2, image.shape[1] - 1)
            if not likelihood[row, column] > _MINIMUM_FOREGROUND:
                continue
            down = (row - box[person, 1]) / (box[person, 3] - box[person, 1])
            for s in range(len(_SLICES)):
                if _SLICES[s][0] <= down < _SLICES[s][1]:
                    count[person, s] += 1
                    for channel in range(3):
                        total[person, s, channel] += _LOGARITHM[image[row, column, channel]]
