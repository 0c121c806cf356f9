"""Boxes whose feet another box covers: there a nearer person may hide them.

On a ground that is seen from above, a person who stands nearer ends lower in the image.
"""

import numpy as np

from stseg.arrays import Flags, Floats

_LEAST_DEPTH = 0.05
"""Least distance by which a nearer person's box ends lower, shares of the height of the box behind it."""
_AT_ONCE = 1000
"""Boxes that are compared with all others at once: a frame may have ten thousand."""


def are_feet_covered(edges: Floats) -> Flags:
    """Whether a box that ends lower covers the middle of each box's lower edge, bool (box,); edges (box, 4), pixels."""
    left, top, right, bottom = edges.T
    covered = np.zeros(len(edges), bool)
    for first in range(0, len(edges), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        middle, end = (left[some, None] + right[some, None]) / 2, bottom[some, None]
        is_lower = bottom > end + _LEAST_DEPTH * (end - top[some, None])
        covered[some] = (is_lower & (left < middle) & (right > middle) & (top < end)).any(1)
    return covered
