"""Cameras calibrated with OpenCV: XML written by its FileStorage, in one file or an intrinsic and an extrinsic one."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.geometry import Lens
from stseg.io.calibrations.foreign_camera import ForeignCamera, camera_from_pose
from stseg.io.outputs.whole_files import replacing
from stseg.io.untrusted.bounded_files import parse_xml
from stseg.io.untrusted.values import parse_numbers, printable

_MATRIX = ("camera_matrix",)
_DISTORTION = ("distortion_coefficients",)
_ROTATION = ("rotation_vectors", "rvec")
_TRANSLATION = ("translation_vectors", "tvec")


def read_opencv_xml(files: Sequence[Path]) -> list[ForeignCamera]:
    """One camera, P = K [R | t], with its lens unless the distortion is zero.

    Parameters
    ----------
    files
        The XML file, or two that share the nodes between them: `camera_matrix` and `distortion_coefficients`,
        `rotation_vectors` or `rvec` (Rodrigues) and `translation_vectors` or `tvec`.

    Raises
    ------
    FormatError
        Where a file is no such XML, or a node is missing, twice there, or of the wrong length.
    """
    roots = [(file, parse_xml(file, "XML of OpenCV's FileStorage")) for file in files]
    file, matrix = _numbers(roots, _MATRIX, (9,))
    _, distortion = _numbers(roots, _DISTORTION, (4, 5, 8, 12, 14))
    _, rotation = _numbers(roots, _ROTATION, (3,))
    _, translation = _numbers(roots, _TRANSLATION, (3,))
    turned = np.asarray(Rotation.from_rotvec(rotation).as_matrix())
    return [camera_from_pose(file, "", None, matrix.reshape(3, 3), turned, translation, distortion)]


def read_opencv_lens(file: Path) -> Lens:
    """The lens of a camera whose XML has at least `camera_matrix` and `distortion_coefficients`.

    Raises
    ------
    FormatError
        Where the file is no such XML.
    """
    roots = [(file, parse_xml(file, "XML of OpenCV's FileStorage"))]
    _, matrix = _numbers(roots, _MATRIX, (9,))
    _, distortion = _numbers(roots, _DISTORTION, (4, 5, 8, 12, 14))
    alone = camera_from_pose(file, "", None, matrix.reshape(3, 3), np.eye(3), np.zeros(3), distortion)
    return alone.lens or Lens(matrix.reshape(3, 3), np.zeros(5))


def write_opencv_lens(path: Path, matrix: Floats, distortion: Floats, overwrite: bool) -> None:
    """Write `camera_matrix` and `distortion_coefficients` as OpenCV's FileStorage does; `read_opencv_lens` reads it."""
    nodes = "\n".join(
        f'<{name} type_id="opencv-matrix">\n  <rows>{rows.shape[0]}</rows>\n  <cols>{rows.shape[1]}</cols>\n'
        f"  <dt>d</dt>\n  <data>{' '.join(map(repr, rows.ravel().tolist()))}</data>\n</{name}>"
        for name, rows in ((_MATRIX[0], matrix), (_DISTORTION[0], distortion.reshape(-1, 1)))
    )
    with replacing(path, overwrite) as part:
        part.write_text(f'<?xml version="1.0"?>\n<opencv_storage>\n{nodes}\n</opencv_storage>\n', encoding="utf-8")


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
    words = text.split()
    numbers = parse_numbers(words) if len(words) in counts else None
    if numbers is None:
        strange = f"{len(words)} numbers: {printable(' '.join(words[:20]))[:60]}"
        raise FormatError(file, node.tag, strange, f"{expected}, all finite")
    return file, np.array(numbers)
