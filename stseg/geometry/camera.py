"""Camera model: a ground homography, a scaled vertical vanishing point, and an optional lens.

The homography `H` maps ground metres to pixels; the vertical `a v` is what one metre of height adds to its third column
(Khan and Shah 2009, eq. 8; docs/how-it-works.md, Geometry). With a projection matrix `[p1 p2 p3 p4]` they are
`[p1 p2 p4]` and `p3`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stseg.arrays import Flags, Floats
from stseg.errors import CalibrationError
from stseg.geometry.fits import homogeneous
from stseg.geometry.lens import Lens, reduction

_SINGULAR = 1e12
_E3 = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Camera:
    """A view of the scene.

    Attributes
    ----------
    name
        Its name in the rig.
    size
        Width and height of its image, pixels.
    ground : float64 (3, 3)
        Homography from ground metres to pixels (undistorted pixels where there is a lens), signed so that points in
        front of the camera have a positive third coordinate.
    vertical : float64 (3,)
        a v: what one metre of height adds to the third column of `ground`.
    lens
        The lens, or None for an ideal image.

    Raises
    ------
    CalibrationError
        Where the homography is singular or the vertical lies in the ground plane.
    """

    name: str
    size: tuple[int, int]
    ground: Floats
    vertical: Floats
    lens: Lens | None = None

    def __repr__(self) -> str:
        lens = "without" if self.lens is None else "with"
        return f"Camera({self.name!r}: {self.size[0]} x {self.size[1]} pixels, {lens} a lens)"

    def __post_init__(self) -> None:
        ground = np.asarray(self.ground, float)
        vertical = np.asarray(self.vertical, float)
        if not (np.isfinite(ground).all() and np.isfinite(vertical).all()):
            raise CalibrationError(f"camera {self.name}", "ground, vertical", "a number that is not finite", "numbers")
        condition = _condition(ground)
        if condition > _SINGULAR:
            raise CalibrationError(f"camera {self.name}", "ground", "a singular homography", "one that can be inverted")
        frame = np.column_stack([ground[:, :2], vertical])
        handedness = float(np.linalg.det(frame))
        if abs(handedness) <= 1e-12 * float(np.prod(np.linalg.norm(frame, axis=0))):
            raise CalibrationError(
                f"camera {self.name}", "vertical", "a direction within the ground plane", "one that leaves it"
            )
        sign = float(np.sign(handedness))
        object.__setattr__(self, "ground", ground * sign)
        object.__setattr__(self, "vertical", vertical * sign)

    @classmethod
    def from_projection(cls, name: str, size: tuple[int, int], projection: Floats, lens: Lens | None = None) -> Camera:
        """A camera from its 3x4 projection matrix [p1 p2 p3 p4] (metres to pixels): H = [p1 p2 p4], a v = p3."""
        p = np.asarray(projection, float)
        return cls(name, size, p[:, [0, 1, 3]], p[:, 2], lens)

    @property
    def projection(self) -> Floats:
        """The 3x4 matrix [h1 h2 av h3], metres to (undistorted) pixels."""
        return np.column_stack([self.ground[:, :2], self.vertical, self.ground[:, 2]])

    @cached_property
    def centre(self) -> Floats:
        """The camera's centre in metres (x, y, z), float64 (3,)."""
        return np.asarray(-np.linalg.solve(self.projection[:, :3], self.projection[:, 3]))

    def reduced(self, factor: int) -> Camera:
        """The view in images reduced by a whole factor; the rest at their right and lower edges is left out."""
        width, height = self.size
        lens = None if self.lens is None else self.lens.reduced(factor)
        smaller = reduction(factor)
        size = (width // factor, height // factor)
        return Camera(self.name, size, smaller @ self.ground, smaller @ self.vertical, lens)

    def plane(self, height: float) -> Floats:
        """Homography of the parallel plane at `height` metres, H(Z) = H + Z a v e3^T, float64 (3, 3)."""
        return np.asarray(self.ground + height * np.outer(self.vertical, _E3))

    def project(self, ground: Floats, height: Floats | float) -> tuple[Floats, Flags]:
        """Pixels of points in space.

        Parameters
        ----------
        ground : float64 (..., 2)
            Metres on the ground.
        height : float64, broadcast with `ground[..., 0]`
            Metres above it.

        Returns
        -------
        float64 (..., 2), bool (...)
            Pixels of the real image, and whether the point is in front of the camera and before the lens's fold. The
            pixel may lie outside the image: see `inside`.
        """
        x, y = ground[..., 0], ground[..., 1]
        x, y, z = np.broadcast_arrays(x, y, np.asarray(height, float))
        image = np.stack([x, y, z, np.ones_like(x)], -1) @ self.projection.T
        ahead = image[..., 2] > 0
        pixel = image[..., :2] / np.where(ahead, image[..., 2], np.nan)[..., None]
        if self.lens is None:
            return pixel, ahead
        bent, unfolded = self.lens.distort(pixel)
        return bent, ahead & unfolded

    def back_project(self, pixel: Floats, height: float = 0.0) -> Floats:
        """Ground metres of the points at `height` that the pixels show, float64 (..., 2); nan above the horizon."""
        ground = homogeneous(self.ideal(pixel)) @ np.linalg.inv(self.plane(height)).T
        ahead = ground[..., 2] > 0
        return np.asarray(ground[..., :2] / np.where(ahead, ground[..., 2], np.nan)[..., None])

    def ideal(self, pixel: Floats) -> Floats:
        """Pixels without the lens's distortion, float64 (..., 2); nan where no ray comes to them."""
        return np.asarray(pixel, float) if self.lens is None else self.lens.undistort(pixel)

    def rays(self, pixel: Floats) -> Floats:
        """Directions in the world of what pixels show, float64 (..., 3); P[:, :3] takes them to (u, v, 1)."""
        return np.asarray(homogeneous(self.ideal(pixel)) @ np.linalg.inv(self.projection[:, :3]).T)

    def sees(self, ground: Floats, height: Floats | float) -> Flags:
        """Whether points lie in front of the camera, before the lens's fold and on the image; as `project`."""
        pixel, ahead = self.project(ground, height)
        return np.asarray(ahead & self.inside(pixel))

    def inside(self, pixel: Floats) -> Flags:
        """Whether pixels lie on the image; pixel centres are integers, so it spans -0.5 .. size - 0.5."""
        width, height = self.size
        u, v = pixel[..., 0], pixel[..., 1]
        return np.asarray((u >= -0.5) & (u < width - 0.5) & (v >= -0.5) & (v < height - 0.5))


def _condition(ground: Floats) -> float:
    """Condition number after scaling rows and columns, so that units alone do not make a matrix look singular."""
    rows = np.abs(ground).max(axis=1, keepdims=True)
    if not rows.all():
        return float("inf")
    scaled = ground / rows
    columns = np.abs(scaled).max(axis=0, keepdims=True)
    return float("inf") if not columns.all() else float(np.linalg.cond(scaled / columns))
