"""Border over which people enter and leave: that of the area, of what the views see of it, and doors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from stseg.arrays import Floats
from stseg.geometry import Grid, Rig

_TRUNK = 1.0
"""Height at which a body must be visible in a view, metres."""
_NOWHERE = 1e6
"""Distance where there is no border at all, cells."""
_AT_DOOR = 1e-6
"""Distance within a door, metres: 0 is beyond the border."""


@dataclass(frozen=True)
class Border:
    """Distance of each ground cell from the border: float64 (y, x), metres."""

    distance: Floats
    grid: Grid

    @classmethod
    def of(cls, rig: Rig) -> Border:
        """The border of the views and the doors of `rig`, and of its area unless that is closed."""
        grid, seen = rig.grid, np.zeros(rig.grid.shape[1:], bool)
        for camera in rig.cameras:
            image, ahead = camera.project(grid.ground, _TRUNK)
            seen |= ahead & camera.inside(image)
        area = seen & grid.inside()
        within = seen | ~grid.inside() if rig.closed else area.copy()
        for door in rig.doors:
            within &= ~grid.touching(door)
        inside = np.pad(within, 1, constant_values=rig.closed)
        cells = np.asarray(distance_transform_edt(inside), float)[1:-1, 1:-1] if not inside.all() else _NOWHERE
        return cls(np.where(area, np.maximum((cells - 0.5) * grid.cell, _AT_DOOR), 0.0), grid)

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
