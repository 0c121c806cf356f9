"""A view of the star: the ground homography H of the potential (Du and Piater 2006, eq. 12), and boxes of people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.bodies.pillars import BodyTable
from stseg.geometry import Camera, Grid

_NOWHERE = 1e6
"""Ground coordinates of pixels above the horizon, metres: a point far outside the area."""


@dataclass(frozen=True)
class StarView:
    """One view.

    Particles in it are pixels of the ideal image, in which the homography is exact; boxes are pixels of the real one.
    """

    camera: Camera
    """The view."""
    table: BodyTable
    """Boxes of people in it."""
    inverse: Floats
    """float64 (3, 3): homography from ideal pixels to the ground."""
    centre: Floats
    """float64 (2,): ground point below the camera, metres."""

    @classmethod
    def of(cls, camera: Camera, grid: Grid) -> StarView:
        """The view of a camera over a grid."""
        return cls(camera, BodyTable.of(camera, grid), np.asarray(np.linalg.inv(camera.ground)), camera.centre[:2])

    def to_pixel(self, ground: Floats) -> Floats:
        """Ideal pixels of ground points (n, 2), metres; float64 (n, 2)."""
        image = ground @ self.camera.ground[:, :2].T + self.camera.ground[:, 2]
        return np.asarray(image[:, :2] / image[:, 2:])

    def to_ground(self, pixel: Floats) -> Floats:
        """Ground points of ideal pixels (n, 2), metres, float64 (n, 2); far off for those above the horizon."""
        point = pixel @ self.inverse[:, :2].T + self.inverse[:, 2]
        ahead = point[:, 2:] > 0
        return np.where(ahead, point[:, :2] / np.where(ahead, point[:, 2:], 1.0), _NOWHERE)

    def ground_slope(self, pixel: Floats) -> Floats:
        """Jacobian of `to_ground` at pixels (n, 2), metres per pixel, float64 (n, 2, 2); 1 above the horizon."""
        depth = pixel @ self.inverse[2, :2] + self.inverse[2, 2]
        ahead = (depth > 0)[:, None, None]
        ground = self.to_ground(pixel)
        slope = self.inverse[:2, :2] - ground[:, :, None] * self.inverse[2, :2]
        return np.where(ahead, slope / np.where(ahead, depth[:, None, None], 1.0), np.eye(2))

    def pixel_slope(self, ground: Floats) -> Floats:
        """Jacobian of `to_pixel` at one ground point (2,), pixels per metre, float64 (2, 2)."""
        depth = self.camera.ground[2] @ (*ground, 1.0)
        pixel = self.to_pixel(ground[None])[0]
        return np.asarray((self.camera.ground[:2, :2] - pixel[:, None] * self.camera.ground[2, :2]) / depth)

    def boxes(self, ground: Floats, height: float) -> Floats:
        """Left, top, right, bottom of people of a height (metres) at ground points (n, 2), real pixels, (n, 4)."""
        return self.table.boxes_of(ground, np.full(len(ground), height))

    def shows(self, ground: Floats, height: float, share: float) -> bool:
        """Whether at least a share of the box of a person at one ground point (2,) lies within the image."""
        left, top, right, bottom = self.boxes(ground[None], height)[0]
        width, tall = self.camera.size
        wide, high = min(right, width) - max(left, 0.0), min(bottom, tall) - max(top, 0.0)
        whole = (right - left) * (bottom - top)
        return bool(wide > 0 and high > 0 and wide * high >= share * whole)
