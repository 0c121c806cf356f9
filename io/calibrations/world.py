"""The frame that a foreign calibration measures in, and cameras carried from it to metres with Z up."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError
from stseg.geometry import Camera, Lens

Unit = Literal["mm", "cm", "m"]
Up = Literal["+z", "-z"]
_PER_METRE: dict[Unit, float] = {"mm": 1000.0, "cm": 100.0, "m": 1.0}


@dataclass(frozen=True, slots=True)
class World:
    """Unit and upward axis of a calibration.

    Attributes
    ----------
    unit
        What its lengths are measured in.
    up
        Which way its Z axis points away from the ground. With -z the world is turned half round the X axis:
        X = x, Y = -y, Z = -z, which keeps it right-handed.
    """

    unit: Unit = "m"
    up: Up = "+z"

    @property
    def from_metres(self) -> Floats:
        """Matrix from homogeneous points in metres, Z up, to this world, float64 (4, 4)."""
        turn = np.array([1.0, 1.0, 1.0] if self.up == "+z" else [1.0, -1.0, -1.0])
        return np.diag([*(turn * _PER_METRE[self.unit]), 1.0])

    def camera(
        self, file: Path, name: str, size: tuple[int, int], projection: Floats, lens: Lens | None = None
    ) -> Camera:
        """The camera whose 3x4 matrix maps points of this world to (undistorted) pixels.

        The matrix is scaled so that the third coordinate is the depth in metres where it is a calibrated camera's.

        Parameters
        ----------
        file
            Where the matrix comes from, for errors.
        name, size, lens
            As in `Camera`.
        projection : float64 (3, 4)

        Raises
        ------
        CalibrationError
            Where the matrix is no camera's.
        """
        in_metres = projection @ self.from_metres
        depth = float(np.linalg.norm(in_metres[2, :3]))
        try:
            return Camera.from_projection(name, size, in_metres / depth if depth > 0 else in_metres, lens)
        except CalibrationError as error:
            raise CalibrationError(file, "projection matrix", error.found, error.expected) from error
