"""Which pixel of each view shows each cell: looked up once, so only the grid is ever sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Floats, Singles
from stseg.geometry import Camera, Rig

UNSEEN = -1


@dataclass(frozen=True)
class Sampling:
    """Look-up tables of a rig.

    Attributes
    ----------
    pixel : int16 (view, plane, y, x, 2)
        Column and row of the pixel nearest to each cell's centre; -1 where the view does not see the cell, or the cell
        does not count.
    distance : float32 (view, y, x)
        Distance of the cell from the camera along the ground, metres.
    """

    pixel: NDArray[np.int16]
    distance: Singles

    @classmethod
    def of(cls, rig: Rig) -> Sampling:
        """The tables of `rig`, lenses and the polygon of the area included."""
        pixel = np.stack([_pixels(camera, rig) for camera in rig.cameras])
        ground = rig.grid.ground
        away = [np.hypot(*np.moveaxis(ground - camera.centre[:2], -1, 0)) for camera in rig.cameras]
        return cls(pixel, np.stack(away).astype(np.float32))

    def views(self) -> Bytes:
        """Number of views that see each cell, uint8 (plane, y, x)."""
        return np.asarray((self.pixel[..., 0] != UNSEEN).sum(0), np.uint8)


def _pixels(camera: Camera, rig: Rig) -> NDArray[np.int16]:
    ground: Floats = rig.grid.ground
    pixel = np.full((*rig.grid.shape, 2), UNSEEN, np.int16)
    for plane, height in enumerate(rig.grid.heights):
        place, ahead = camera.project(ground, float(height))
        seen = ahead & camera.inside(place) & rig.grid.inside()
        pixel[plane][seen] = np.rint(place[seen]).astype(np.int16).clip(0, np.array(camera.size) - 1)
    return pixel
