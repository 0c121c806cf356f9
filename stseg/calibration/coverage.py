"""How many views see each cell of the grid."""

from __future__ import annotations

import numpy as np

from stseg.arrays import Bytes
from stseg.geometry import Rig


def coverage(rig: Rig) -> Bytes:
    """Number of views whose image holds each cell's centre, uint8 (plane, y, x)."""
    count = np.zeros(rig.grid.shape, np.uint8)
    for plane, height in enumerate(rig.grid.heights.tolist()):
        for camera in rig.cameras:
            pixel, ahead = camera.project(rig.grid.ground, height)
            count[plane] += ahead & camera.inside(pixel)
    return count
