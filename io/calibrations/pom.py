"""EPFL's (POM's) calibrations: per camera the homographies from the image to the ground plane and to the head plane.

Both lead to cells of the same ground grid, whose side is the world's unit; its rows often count downwards, which makes
the world left-handed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.errors import CalibrationError, FormatError
from stseg.geometry.fits import fit_vertical, homogeneous
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.untrusted.bounded_files import read_text
from stseg.io.untrusted.numbers import parse_numbers

_EXPECTED = "two 3x3 matrices, image to ground plane and image to head plane, a row a line"
_SAMPLES = 9  # pixels along each side of the image at which the head plane is sampled


def read_pom(files: Sequence[Path], size: tuple[int, int], head: float) -> list[ForeignCamera]:
    """One camera.

    Parameters
    ----------
    files
        Text with the ground homography and then the head homography, or a file of each. Lines of three numbers
        are read (brackets, commas and semicolons count as blanks), all others ignored.
    size
        Width and height of the image, pixels.
    head
        Height of the head plane, in sides of the ground's cells.

    Raises
    ------
    FormatError
        Where there are not two matrices.
    CalibrationError
        Where they are no planes that a camera sees.
    """
    rows = [row for file in files for row in _rows(file)]
    names = " + ".join(map(str, files))
    if len(rows) != 6:
        raise FormatError(names, "", f"{len(rows)} lines of three numbers", _EXPECTED)
    ground, heads = np.array(rows[:3]), np.array(rows[3:])
    pixel = np.stack(np.meshgrid(*(np.linspace(0, side - 1, _SAMPLES) for side in size)), -1).reshape(-1, 2)
    try:
        homography, to_head = np.linalg.inv(ground), np.linalg.inv(heads)
    except np.linalg.LinAlgError as error:
        raise CalibrationError(names, "homography", "a singular matrix", "one that can be inverted") from error
    # The lower edge of an image shows the ground, if anything does.
    foot = homogeneous(np.array([(size[0] - 1) / 2, size[1] - 1.0])) @ ground.T
    homography = homography * np.sign(float(homography[2] @ (foot / foot[2])))
    place, visible = _seen(homography, homogeneous(pixel) @ ground.T)
    image = homogeneous(place[visible]) @ to_head.T
    if visible.sum() < _SAMPLES:
        raise CalibrationError(names, "homography", "a ground plane that the image hardly shows", "one that it does")
    above = image[:, :2] / image[:, 2:]
    vertical = fit_vertical(homography, place[visible], np.full(int(visible.sum()), head), above)
    projection = np.column_stack([homography[:, :2], vertical, homography[:, 2]])
    return [ForeignCamera(files[0], "", size, projection)]


def _seen(homography: Floats, ground: Floats) -> tuple[Floats, Floats]:
    """Ground points of homogeneous ones, and which of them lie in front of the camera."""
    place = ground[:, :2] / ground[:, 2:]
    return place, homogeneous(place) @ homography[2] > 0


def _rows(file: Path) -> list[list[float]]:
    try:
        text = read_text(file)
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, _EXPECTED) from error
    except ValueError as error:
        raise FormatError(file, "", "what is no text", _EXPECTED) from error
    found = (_three(line) for line in text.translate(str.maketrans("[](){},;", " " * 8)).splitlines())
    return [row for row in found if row is not None]


def _three(line: str) -> list[float] | None:
    words = line.split()
    return parse_numbers(words) if len(words) == 3 else None
