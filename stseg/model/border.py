"""Border over which people enter and leave: that of the area, and of what the views see of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from stseg.arrays import Floats
from stseg.geometry import Grid, Rig

_TRUNK = 1.0
"""Height at which a body must be visible in a view, metres."""


@dataclass(frozen=True)
class Border:
    """Distance of each ground cell from the border: float64 (y, x), metres."""

    distance: Floats
    grid: Grid

    @classmethod
    def of(cls, rig: Rig) -> Border:
        """The border of `rig`'s area and of its views."""
        seen = np.zeros(rig.grid.shape[1:], bool)
        for camera in rig.cameras:
            image, ahead = camera.project(rig.grid.ground, _TRUNK)
            seen |= ahead & camera.inside(image)
        inside = np.pad(seen & rig.grid.inside(), 1)
        away = np.asarray(distance_transform_edt(inside), float)[1:-1, 1:-1]
        return cls((away - 0.5).clip(0) * rig.grid.cell, rig.grid)

    def away(self, ground: Floats) -> Floats:
        """Distance of ground points (n, 2) from the border, metres, float64 (n,); 0 beyond it."""
        corner = np.array([self.grid.x[0], self.grid.y[0]])
        cell = np.floor((ground - corner) / self.grid.cell).astype(int)
        rows, columns = self.distance.shape
        within = ((cell >= 0) & (cell < [columns, rows])).all(1)
        column, row = cell[:, 0].clip(0, columns - 1), cell[:, 1].clip(0, rows - 1)
        return np.where(within, self.distance[row, column], 0.0)

    def inside(self, ground: Floats, width: float) -> Floats:
        """How far inside ground points (n, 2) are: 0 at the border, 1 from `width` metres on, float64 (n,)."""
        return np.minimum(self.away(ground) / width, 1.0)
