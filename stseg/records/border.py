"""Border over which people enter and leave: that of the area, of what the views see of it, and doors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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
        grid, visible = rig.grid, np.zeros(rig.grid.shape[1:], bool)
        for camera in rig.cameras:
            visible |= camera.sees(grid.ground, _TRUNK)
        area = visible & grid.inside()
        within = visible | ~grid.inside() if rig.closed else area.copy()
        for door in rig.doors:
            within &= ~grid.touching(door)
        inside = np.pad(within, 1, constant_values=rig.closed)
        cells = np.asarray(distance_transform_edt(inside), float)[1:-1, 1:-1] if not inside.all() else _NOWHERE
        return cls(np.where(area, np.maximum((cells - 0.5) * grid.cell, _AT_DOOR), 0.0), grid)

    @cached_property
    def _framed(self) -> Floats:
        """The distances, and after the last row and column, which also stand before the first, those beyond: 0."""
        return np.pad(self.distance, ((0, 1), (0, 1)))

    @cached_property
    def _corner(self) -> Floats:
        return np.array([self.grid.x[0], self.grid.y[0]])

    @cached_property
    def _beyond(self) -> Floats:
        """Column and row behind the last ones."""
        return np.array(self.distance.shape[::-1], float)

    def away(self, ground: Floats) -> Floats:
        """Distance of ground points (n, 2) from the border, metres, float64 (n,); 0 beyond it."""
        cell = np.floor((ground - self._corner) / self.grid.cell)
        column, row = np.minimum(np.maximum(cell, -1.0), self._beyond).astype(int).T
        return np.asarray(self._framed[row, column])

    def inside(self, ground: Floats, width: float) -> Floats:
        """Depth of ground points (n, 2) inside: 0 at the border, 1 from `width` metres on, float64 (n,)."""
        return np.minimum(self.away(ground) / width, 1.0)
