"""A rig: the cameras of one recording and the ground that they watch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError
from stseg.geometry.camera import Camera
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
    """

    name: str
    frame_rate: float
    grid: Grid
    cameras: tuple[Camera, ...]

    def reduced(self, factors: Sequence[int]) -> Rig:
        """The rig with each camera's images reduced by a whole factor."""
        cameras = tuple(camera.reduced(factor) for camera, factor in zip(self.cameras, factors, strict=True))
        return replace(self, cameras=cameras)

    def require_coverage(self) -> None:
        """Raise CalibrationError for a camera that sees no cell of the area on any plane."""
        ground = self.grid.ground[self.grid.inside()]
        for camera in self.cameras:
            if not any(np.any(_sees(camera, ground, height)) for height in self.grid.heights):
                raise CalibrationError(
                    f"camera {camera.name}", "ground", "a view that sees nothing of the area", "some cell in its image"
                )


def _sees(camera: Camera, ground: Floats, height: float) -> Floats:
    pixel, ahead = camera.project(ground, height)
    return np.asarray(ahead & camera.inside(pixel))
