"""The world frame of a foreign calibration, and the transformation of its cameras to metres with Z up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import rq

from stseg.arrays import Floats
from stseg.errors import CalibrationError, ConfigError
from stseg.geometry import Camera
from stseg.geometry.rig import CAMERA_HEIGHTS
from stseg.io.calibrations.foreign_camera import ForeignCamera

Up = Literal["+z", "-z", "+y", "-y", "+x", "-x"]
UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0}
"""Metres in each unit that has a name."""
_TURNS: dict[Up, list[list[float]]] = {
    "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "+y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "+x": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "-x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
}
_USUAL_HEIGHT = 2.5  # metres above the ground, of a camera


@dataclass(frozen=True, slots=True)
class World:
    """Unit, upward axis and handedness of a calibration. ConfigError where the unit is unknown."""

    unit: str = "m"
    """Unit of length: mm, cm, m, or a number of metres."""
    up: Up = "+z"
    """The axis that points away from the ground. The others follow by half or quarter turns, which keep left and right:
    with -z, X = x, Y = -y, Z = -z; with -y (a camera's own axes), X = x, Y = -z, Z = y."""
    mirrored: bool = False
    """Whether it is left-handed, as grids whose rows count downwards: y is then reversed."""

    def __post_init__(self) -> None:
        try:
            sound = 0 < self.metres < np.inf
        except ValueError:
            sound = False
        if not sound:
            raise ConfigError("--unit", "", repr(self.unit), "mm, cm, m, or how many metres a unit is")

    @property
    def metres(self) -> float:
        """Metres in one of its units."""
        return UNITS[self.unit] if self.unit in UNITS else float(self.unit)

    @property
    def from_metres(self) -> Floats:
        """Matrix from homogeneous points in metres, Z up, to this world, float64 (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.array(_TURNS[self.up]) / self.metres
        return matrix @ np.diag([1.0, -1.0 if self.mirrored else 1.0, 1.0, 1.0])

    def camera(self, foreign: ForeignCamera, name: str, size: tuple[int, int]) -> Camera:
        """The camera in metres with Z up.

        The matrix is scaled so that the third coordinate is the depth in metres where it is a calibrated camera's.

        CalibrationError where the matrix is not that of a camera.
        """
        in_metres = foreign.projection @ self.from_metres
        depth = float(np.linalg.norm(in_metres[2, :3]))
        try:
            return Camera.from_projection(name, size, in_metres / depth if depth > 0 else in_metres, foreign.lens)
        except CalibrationError as error:
            raise CalibrationError(foreign.file, "projection matrix", error.found, error.expected) from error


def guess_up(cameras: Sequence[ForeignCamera], mirrored: bool = False) -> Up:
    """The axis that points upwards in most images: cameras are mounted nearly upright."""
    upward = np.sum([(1 if mirrored else -1) * _rotation(camera)[1] for camera in cameras], axis=0)
    axis = int(np.abs(upward).argmax())
    name = f"{'+' if upward[axis] > 0 else '-'}{'xyz'[axis]}"
    return next(up for up in get_args(Up) if up == name)


def guess_unit(cameras: Sequence[ForeignCamera], up: Up, mirrored: bool = False) -> str:
    """The unit in which camera heights are most plausible.

    CalibrationError where the cameras are below the ground in any unit.
    """
    height = median_height(cameras, World("m", up, mirrored))
    if height <= 0:
        mirror = "" if mirrored else "--mirrored where the calibration is left-handed, or "
        found, expected = f"cameras below the ground with {up} upwards", f"them above it: give {mirror}--up"
        raise CalibrationError(cameras[0].file, "camera centres", found, expected)
    return _likeliest_unit(height)


def require_median_height(cameras: Sequence[ForeignCamera], world: World) -> None:
    """`require_unit` of the cameras' median height."""
    require_unit(cameras[0].file, "cameras", median_height(cameras, world), world)


def require_unit(place: object, what: str, height: float, world: World) -> None:
    """Refuse a unit with implausible camera heights, metres, where another gives plausible ones; CalibrationError."""
    lowest, highest = CAMERA_HEIGHTS
    better = _likeliest_unit(height / world.metres)
    if height > 0 and not lowest <= height <= highest and lowest <= height / world.metres * UNITS[better] <= highest:
        found = f"{what} {height:.4g} m above the ground"
        expected = f"{lowest} to {highest:.0f} m: are its lengths in {better}? (--unit {better})"
        raise CalibrationError(place, f"--unit {world.unit}", found, expected)


def _likeliest_unit(height: float) -> str:
    return min(UNITS, key=lambda unit: abs(np.log(max(height, 1e-300) * UNITS[unit] / _USUAL_HEIGHT)))


def median_height(cameras: Sequence[ForeignCamera], world: World) -> float:
    """Median height of the cameras in that world, metres; negative below the ground."""
    return float(np.median([world.camera(camera, "camera", (1, 1)).centre[2] for camera in cameras]))


def _rotation(camera: ForeignCamera) -> Floats:
    """R of P ~ K [R | t] with a positive diagonal of K and det R = 1, float64 (3, 3); -R in a left-handed world."""
    triangle, rotation = rq(camera.projection[:, :3])
    rotation = np.sign(np.diag(triangle))[:, None] * rotation
    return np.asarray(rotation * np.sign(np.linalg.det(rotation)))
