"""Cameras calibrated with OpenCV: XML written by its FileStorage, in one file or an intrinsic and an extrinsic one."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.geometry import Camera, Lens
from stseg.io.calibrations.world import World

_MATRIX = ("camera_matrix",)
_DISTORTION = ("distortion_coefficients",)
_ROTATION = ("rotation_vectors", "rvec")
_TRANSLATION = ("translation_vectors", "tvec")


def read_opencv_xml(files: Sequence[Path], name: str, size: tuple[int, int], world: World) -> Camera:
    """One camera, P = K [R | t], with its lens unless the distortion is zero.

    Parameters
    ----------
    files
        The XML file, or two that share the nodes between them: `camera_matrix` and `distortion_coefficients`,
        `rotation_vectors` or `rvec` (Rodrigues) and `translation_vectors` or `tvec`.
    name, size
        Of the camera; the files do not tell.
    world
        Unit and upward axis of the translation.

    Raises
    ------
    FormatError
        Where a file is no such XML, or a node is missing, twice there, or of the wrong length.
    CalibrationError
        Where the numbers make no camera.
    """
    roots = [(file, _parse(file)) for file in files]
    file, matrix = _numbers(roots, _MATRIX, (9,))
    matrix = matrix.reshape(3, 3)
    if min(matrix[0, 0], matrix[1, 1]) <= 0 or matrix[1, 0] != 0 or matrix[2].tolist() != [0, 0, 1]:
        raise FormatError(file, "camera_matrix", matrix.tolist(), "[[fx, s, cx], [0, fy, cy], [0, 0, 1]]")
    distortion = _distortion(roots)
    _, rotation = _numbers(roots, _ROTATION, (3,))
    file, translation = _numbers(roots, _TRANSLATION, (3,))
    projection = matrix @ np.column_stack([Rotation.from_rotvec(rotation).as_matrix(), translation])
    return world.camera(file, name, size, projection, Lens(matrix, distortion) if distortion.any() else None)


def _distortion(roots: Sequence[tuple[Path, ElementTree.Element]]) -> Floats:
    file, distortion = _numbers(roots, _DISTORTION, (4, 5, 8, 12, 14))
    if distortion[5:].any():
        raise FormatError(file, _DISTORTION[0], f"{len(distortion)} coefficients", "at most 5: k1, k2, p1, p2, k3")
    return distortion[:5]


def _parse(file: Path) -> ElementTree.Element:
    try:
        text = file.read_bytes().decode("utf-8-sig")
        # Entities are declared in a document type, which no calibration has: refusing it leaves nothing to expand.
        # The check is on decoded text and the parser gets that text, so no declared encoding can hide one.
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise FormatError(file, "", "a document type declaration", "XML of OpenCV's FileStorage, which has none")
        return ElementTree.fromstring(text)
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, "a calibration file") from error
    except (UnicodeDecodeError, ElementTree.ParseError) as error:
        raise FormatError(file, "", f"what is not XML ({error})", "XML of OpenCV's FileStorage") from error


def _numbers(
    roots: Sequence[tuple[Path, ElementTree.Element]], names: tuple[str, ...], counts: tuple[int, ...]
) -> tuple[Path, Floats]:
    """The file and the numbers of the one node with one of these names."""
    files = " + ".join(str(file) for file, _ in roots)
    found = [(file, node) for file, root in roots for name in names for node in root.iter(name)]
    if len(found) != 1:
        raise FormatError(files, " or ".join(names), f"{len(found)} such nodes", "one")
    file, node = found[0]
    text = node.findtext("data", node.text or "")
    expected = f"{' or '.join(map(str, counts))} numbers"
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise FormatError(file, node.tag, str(error), expected) from error
    if len(numbers) not in counts or not np.isfinite(numbers).all():
        shown = f"{len(numbers)} numbers: {' '.join(text.split())[:60]}"
        raise FormatError(file, node.tag, shown, f"{expected}, all finite")
    return file, numbers
