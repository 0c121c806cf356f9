"""A camera of another program's calibration: in the world frame of that calibration, before units and axes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError, FormatError, InputError
from stseg.geometry import Lens
from stseg.io.lenses import checked_lens
from stseg.io.toml import Table

_KEYS = {"matrix": "camera_matrix", "distortion": "distortion_coefficients"}
_ORTHONORMAL = 0.01  # by which printed rotations may miss


@dataclass(frozen=True)
class ForeignCamera:
    """A camera in a foreign world."""

    file: Path
    """The calibration, for errors."""
    name: str
    """Its name in the calibration, or empty."""
    size: tuple[int, int] | None
    """Width and height of its image, pixels; None where the calibration lacks them."""
    projection: Floats
    """float64 (3, 4): points of the foreign world to (undistorted) pixels."""
    lens: Lens | None = None
    """The lens, or None for an ideal image."""


class ForeignTable(Table):
    """A table of a calibration; its errors are `FormatError`."""

    def error(self, name: str, found: object, expected: str) -> InputError:
        """An error at the key `name`."""
        return FormatError(self.file, self.key(name), found, expected)

    def matrix(self, name: str, rows: int, columns: int) -> Floats:
        """A matrix in nested lists, or all of it in one list, row by row; float64 (rows, columns)."""
        value = self.values.get(name)
        flat = isinstance(value, list) and not any(isinstance(row, list) for row in value)
        return self.numbers(name, rows * columns).reshape(rows, columns) if flat else self.numbers(name, rows, columns)

    def vector(self, name: str) -> Floats:
        """A vector in one list, or in a list of lists of one; float64 (3,)."""
        value = self.values.get(name)
        nested = isinstance(value, list) and any(isinstance(row, list) for row in value)
        return self.numbers(name, 3, 1)[:, 0] if nested else self.numbers(name, 3)


def camera_from_pose(
    file: Path,
    name: str,
    size: tuple[int, int] | None,
    matrix: Floats,
    rotation: Floats,
    translation: Floats,
    distortion: Floats,
    fisheye: bool = False,
) -> ForeignCamera:
    """A camera P = K [R | t], with its lens unless that is none; file, name and size as in `ForeignCamera`.

    K, pixels, and R are float64 (3, 3), t float64 (3,) in lengths of the foreign world. The distortion is float64
    (n,), OpenCV's coefficients; those beyond the lens model's must be zero. FormatError where these are no camera
    matrix, no rotation, or too many coefficients; CalibrationError where R is a mirror.
    """
    key = f"camera {name}" if name else "camera"

    def error(name: str, found: object, expected: str) -> FormatError:
        return FormatError(file, f"{key}, {_KEYS[name]}", found, expected)

    lens = checked_lens(matrix, distortion, "fisheye" if fisheye else "pinhole", error)
    if not np.abs(rotation @ rotation.T - np.eye(3)).max() <= _ORTHONORMAL:
        raise FormatError(file, f"{key}, rotation", np.round(rotation, 3).tolist(), "a rotation")
    if np.linalg.det(rotation) < 0:
        raise CalibrationError(file, f"{key}, rotation", "a mirror", "a rotation, which keeps left and right")
    projection = matrix @ np.column_stack([rotation, translation])
    return ForeignCamera(file, name, size, projection, lens if distortion.any() or fisheye else None)
