"""Image reduction: the factor at which standing people still span enough rows."""

from __future__ import annotations

import math

import numpy as np

from stseg.geometry.camera import Camera
from stseg.geometry.grid import Grid

BODY_HEIGHT = 1.7
"""Height of a standing person, metres."""


def greatest_reduction(camera: Camera, grid: Grid, rows: float) -> int:
    """The greatest whole factor by which a view's images can be reduced.

    Parameters
    ----------
    camera, grid
        The view and its ground.
    rows
        Pixels that a standing person spans at least afterwards, in the median over the cells where they are seen whole.

    Returns
    -------
    int
        1 or more.
    """
    ground = grid.ground[grid.inside()]
    feet, before_feet = camera.project(ground, 0.0)
    head, before_head = camera.project(ground, BODY_HEIGHT)
    whole = before_feet & before_head & camera.inside(feet) & camera.inside(head)
    if not whole.any():
        return 1
    spanned = float(np.median(np.hypot(*(feet - head)[whole].T)))
    return max(1, math.floor(spanned / rows))
