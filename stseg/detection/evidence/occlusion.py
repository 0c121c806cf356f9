"""Occlusion of pillars by each other in the views with boxes, as ragged rows: few candidates hide a part of another.

A pool grows from search to search of a frame, and the lists of those that it had stay; only pairs with new ones are
looked for.
"""

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.problem import RaggedArray
from stseg.kernels.accelerate import kernel, part

_CLEARANCE = 0.1
"""Least difference of distances from the camera at which one body occludes another, metres."""
_INSET = 0.1
"""Share of a box's width at either side that is no trunk and occludes nothing."""


@kernel
def occluders_of(
    bodies: Floats, distance: Floats, sizes: Floats, is_blind: Flags, base: RaggedArray, base_candidates: int
) -> RaggedArray:
    """Occluders of each candidate, rising, with the share that each leaves visible of the box inside the image.

    `bodies` float64 (view, candidate, 4) are left, top, right, bottom, pixels, nan where a view cannot see the place;
    `distance` float64 (view, candidate) is from the camera on the ground, metres; `sizes` float64 (view, 2) are widths
    and heights of the images, pixels; `is_blind` bool (view,) marks views without occlusion. `base` are the lists of
    the first `base_candidates`. The row of a candidate in a view is view * candidates + candidate.
    """
    views, candidates = distance.shape
    start = np.zeros(views * candidates + 1, np.int64)
    most = len(base.item) + views * (candidates * candidates - base_candidates * base_candidates)
    item, value, number = np.empty(most, np.int64), np.empty(most), 0  # what is not filled takes no memory
    for view in range(views):
        for i in range(candidates):
            first = 0
            if i < base_candidates:
                first, row = base_candidates, view * base_candidates + i
                for k in range(base.start[row], base.start[row + 1]):
                    item[number], value[number] = base.item[k], base.value[k]
                    number += 1
            if not is_blind[view]:
                number = _add_occluders(i, first, bodies[view], distance[view], sizes[view], item, value, number)
            start[view * candidates + i + 1] = number
    return RaggedArray(start, item[:number].copy(), value[:number].copy())


@part
def _add_occluders(
    i: int, first: int, bodies: Floats, distance: Floats, size: Floats, item: Ints, value: Floats, number: int
) -> int:
    """Add to the first `number` items the occluders of i among the candidates from `first` on; their number."""
    left, right = max(bodies[i, 0], 0.0), min(bodies[i, 2], size[0])
    top, bottom = max(bodies[i, 1], 0.0), min(bodies[i, 3], size[1])
    area = max(right - left, 0.0) * max(bottom - top, 0.0)
    if not area > 0:
        return number
    for k in range(first, len(bodies)):
        if not (bodies[k, 2] > left and bodies[k, 0] < right and distance[k] < distance[i] - _CLEARANCE):
            continue
        inset = _INSET * (bodies[k, 2] - bodies[k, 0])
        wide = min(right, bodies[k, 2] - inset) - max(left, bodies[k, 0] + inset)
        tall = min(bottom, bodies[k, 3]) - max(top, bodies[k, 1])
        if wide > 0 and tall > 0:
            item[number], value[number] = k, 1.0 - min(wide * tall / area, 1.0)
            number += 1
    return number
