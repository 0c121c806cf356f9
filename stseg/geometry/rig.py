"""A rig: the cameras of one recording and the ground that they watch; what a camera shows of that ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from stseg.errors import CalibrationError
from stseg.geometry.camera import Camera
from stseg.geometry.fits import homogeneous
from stseg.geometry.grid import Grid


@dataclass(frozen=True)
class Rig:
    """Cameras and scene.

    Attributes
    ----------
    name
        The scene's name.
    frame_rate
        Frames per second of the recording.
    grid
        Ground cells and planes.
    cameras
        The views, in the order of the rig file.
    doors : (x0, y0, x1, y1) each
        Rectangles of ground where people come and go, metres.
    closed
        Whether people cross the border of the area through doors alone.
    """

    name: str
    frame_rate: float
    grid: Grid
    cameras: tuple[Camera, ...]
    doors: tuple[tuple[float, float, float, float], ...] = ()
    closed: bool = False

    def __repr__(self) -> str:
        names = ", ".join(camera.name for camera in self.cameras)
        return f"Rig({self.name!r}: {len(self.cameras)} cameras ({names}), {self.frame_rate:g} frames/s, {self.grid!r})"

    @classmethod
    def from_homographies(
        cls,
        homographies: ArrayLike,
        verticals: ArrayLike,
        sizes: Sequence[tuple[int, int]],
        grid: Grid,
        frame_rate: float,
        *,
        names: Sequence[str] = (),
        name: str = "scene",
    ) -> Rig:
        """A rig from ground homographies and verticals.

        Parameters
        ----------
        homographies : (view, 3, 3)
            From metres on the ground to pixels.
        verticals : (view, 3)
            What a metre of height adds to the third column of each homography: the third column of a projection
            matrix.
        sizes
            Width and height of each camera's images, pixels.
        grid
            Ground cells and planes.
        frame_rate
            Frames per second.
        names
            Of the cameras; cam1, cam2, ... by default.
        name
            Of the scene.

        Raises
        ------
        CalibrationError
            Where the arrays are not of those shapes, or a camera's geometry is singular or sees nothing of the area.
        """
        ground, vertical = np.asarray(homographies, float), np.asarray(verticals, float)
        count = len(sizes)
        if ground.shape != (count, 3, 3) or vertical.shape != (count, 3):
            found = f"arrays of {ground.shape} and {vertical.shape} for {count} cameras"
            raise CalibrationError("homographies, verticals", "", found, "(view, 3, 3) and (view, 3)")
        names = names or [f"cam{k + 1}" for k in range(count)]
        if len(set(names)) != count:
            raise CalibrationError("names", "", ", ".join(names), f"{count} different names")
        views = zip(names, sizes, ground, vertical, strict=True)
        rig = cls(name, frame_rate, grid, tuple(Camera(camera_name, size, h, v) for camera_name, size, h, v in views))
        rig.require_coverage()
        return rig

    @classmethod
    def from_projections(
        cls,
        projections: ArrayLike,
        sizes: Sequence[tuple[int, int]],
        grid: Grid,
        frame_rate: float,
        *,
        names: Sequence[str] = (),
        name: str = "scene",
    ) -> Rig:
        """A rig from projection matrices (view, 3, 4), metres to pixels; the rest as of `from_homographies`."""
        matrix = np.asarray(projections, float)
        if matrix.shape != (len(sizes), 3, 4):
            found = f"an array of {matrix.shape} for {len(sizes)} cameras"
            raise CalibrationError("projections", "", found, "(view, 3, 4)")
        ground, vertical = matrix[:, :, [0, 1, 3]], matrix[:, :, 2]
        return cls.from_homographies(ground, vertical, sizes, grid, frame_rate, names=names, name=name)

    def reduced(self, factors: Sequence[int]) -> Rig:
        """The rig with each camera's images reduced by a whole factor."""
        cameras = tuple(camera.reduced(factor) for camera, factor in zip(self.cameras, factors, strict=True))
        return replace(self, cameras=cameras)

    def require_coverage(self) -> None:
        """Raise CalibrationError for a camera that sees no cell of the area on any plane."""
        ground = self.grid.ground[self.grid.inside()]
        for camera in self.cameras:
            if not any(camera.sees(ground, height).any() for height in self.grid.heights):
                found, expected = "a view that sees nothing of the area", "some cell in its image"
                if is_mirrored(camera, self.grid):
                    found = "a mirrored ground (y counted downwards, as in a picture?)"
                    expected = (
                        "y counted upwards: change the sign of y, in the matrix its second column, and in the area"
                    )
                raise CalibrationError(f"camera {camera.name}", "ground", found, expected)


def is_mirrored(camera: Camera, grid: Grid) -> bool:
    """Whether the camera's image would show the area, below its horizon, were it not behind the camera.

    A camera's matrix is signed for a right-handed world. In a mirrored one the same matrix has the other sign, and all
    that it shows lies behind it. (Above its horizon a camera sees nothing of the ground in any case.)
    """
    ground = grid.ground[grid.inside()]
    for height in grid.heights:
        plane = camera.plane(float(height))
        image = homogeneous(ground) @ plane.T
        finite = np.abs(image[:, 2]) > 1e-12
        pixel = image[finite, :2] / image[finite, 2:]
        inside = camera.inside(pixel)
        a, b, c = np.linalg.inv(plane)[2]  # the vanishing line e3^T H^-1
        below = pixel[:, 1] > -(a * pixel[:, 0] + c) / b if b else np.ones(len(pixel), bool)
        if (inside & (image[finite, 2] > 0)).any():
            return False
        if (inside & below).any():
            return True
    return False


BODY_HEIGHT = 1.7
"""Height of a standing person, metres."""
CAMERA_HEIGHTS = (0.3, 60.0)
"""Plausible heights of cameras above the ground, metres."""


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
