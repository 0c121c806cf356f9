"""Cameras in XML: written by OpenCV's FileStorage, or Tsai's model as PETS 2009 has it.

OpenCV: in one file, or an intrinsic and an extrinsic one.

Tsai: lengths in millimetres, one radial coefficient. R. Y. Tsai, A versatile camera calibration technique, IEEE J.
Robotics and Automation 3(4), 1987. A ray through the undistorted sensor point X_u = f x / z shows at X_d with
X_u = X_d (1 + kappa1 |X_d|^2), and that at pixel u = s_x X_d / d_px + c_x, v = Y_d / d_py + c_y. Our lens runs the
other way, from undistorted to distorted, so its radial coefficients (the rational form: a polynomial does not follow a
strong lens) are fitted to the inverse.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.geometry import Lens
from stseg.io.calibrations.foreign_camera import ForeignCamera, camera_from_pose
from stseg.io.outputs.whole_files import MARK, write_file
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_xml
from stseg.io.untrusted.values import parse_numbers

_MATRIX = ("camera_matrix",)
_DISTORTION = ("distortion_coefficients",)
_HEAD = f'<?xml version="1.0"?>\n<!-- {MARK.decode()} -->\n'
_ROTATION = ("rotation_vectors", "rvec")
_TRANSLATION = ("translation_vectors", "tvec")
_BEFORE_TURN = 0.9
"""Share of the radius at which the cubic turns round up to which it is followed."""
_ROUNDS = 3


def read_opencv_xml(files: Sequence[Path]) -> list[ForeignCamera]:
    """One camera, P = K [R | t], with its lens unless that is none; a fisheye where `fisheye_model` is not 0.

    The nodes `camera_matrix`, `distortion_coefficients`, `rotation_vectors` or `rvec` (Rodrigues) and
    `translation_vectors` or `tvec` stand in one file, or are shared between two. FormatError where a file is no such
    XML, or a node is missing, twice there, or of the wrong length.
    """
    roots = [(file, parse_xml(file, "XML of OpenCV's FileStorage")) for file in files]
    _, rotation = _numbers(roots, _ROTATION, (3,))
    _, translation = _numbers(roots, _TRANSLATION, (3,))
    return [_camera(roots, rotation, translation)]


def read_opencv_lens(file: Path) -> Lens:
    """The lens of a camera whose XML has at least `camera_matrix` and `distortion_coefficients`.

    FormatError where the file is no such XML.
    """
    alone = _camera([(file, parse_xml(file, "XML of OpenCV's FileStorage"))], np.zeros(3), np.zeros(3))
    return alone.lens or Lens(alone.projection[:, :3], np.zeros(5))


def _camera(roots: Sequence[tuple[Path, ElementTree.Element]], rotation: Floats, translation: Floats) -> ForeignCamera:
    file, matrix = _numbers(roots, _MATRIX, (9,))
    _, distortion = _numbers(roots, _DISTORTION, (4, 5, 8, 12, 14))
    fisheye = any((root.findtext("fisheye_model") or "0").strip() != "0" for _, root in roots)
    turned = np.asarray(Rotation.from_rotvec(rotation).as_matrix())
    return camera_from_pose(file, "", None, matrix.reshape(3, 3), turned, translation, distortion, fisheye)


def write_opencv_lens(path: Path, lens: Lens, overwrite: bool) -> None:
    """Write `camera_matrix` and `distortion_coefficients` as OpenCV's FileStorage does; `read_opencv_lens` reads it."""
    nodes = "\n".join(
        f'<{name} type_id="opencv-matrix">\n  <rows>{rows.shape[0]}</rows>\n  <cols>{rows.shape[1]}</cols>\n'
        f"  <dt>d</dt>\n  <data>{' '.join(map(repr, rows.ravel().tolist()))}</data>\n</{name}>"
        for name, rows in ((_MATRIX[0], lens.matrix), (_DISTORTION[0], lens.distortion.reshape(-1, 1)))
    )
    write_file(path, f"{_HEAD}<opencv_storage>\n{nodes}\n</opencv_storage>\n".encode(), overwrite)


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
        strange = f"{len(words)} numbers: {' '.join(words[:20])[:60]}"
        raise FormatError(file, node.tag, strange, f"{expected}, all finite")
    return file, np.array(numbers)


def read_tsai_xml(files: Sequence[Path]) -> list[ForeignCamera]:
    """One camera a file, `<Camera>` with `<Geometry>`, `<Intrinsic>` and `<Extrinsic>`.

    FormatError where a file is no such XML, or a number is missing or none.
    """
    return [_read_tsai(file) for file in files]


def _read_tsai(file: Path) -> ForeignCamera:
    root = parse_xml(file, "XML of a Tsai calibration")
    width, height, dpx, dpy = _attributes(file, root, "Geometry", "width height dpx dpy")
    focal, kappa, cx, cy, sx = _attributes(file, root, "Intrinsic", "focal kappa1 cx cy sx")
    *translation, rx, ry, rz = _attributes(file, root, "Extrinsic", "tx ty tz rx ry rz")
    if min(width, height, dpx, dpy, focal, sx) <= 0:
        raise FormatError(file, "Geometry, Intrinsic", "a length that is not above 0", "lengths above 0")
    if width % 1 or height % 1 or max(width, height) > limits.SIDE or width * height > limits.PIXELS:
        expected = f"whole pixels, at most {limits.PIXELS}"
        raise FormatError(file, "Geometry", f"{width:g} x {height:g} pixels", expected)
    matrix = np.array([[focal * sx / dpx, 0, cx], [0, focal / dpy, cy], [0, 0, 1]])
    corners = (np.array([[0, 0], [width, 0], [0, height], [width, height]]) - (cx, cy)) / (matrix[0, 0], matrix[1, 1])
    radial = _inverse_radial(kappa * focal**2, float(np.hypot(*corners.T).max()))
    rotation = np.asarray(Rotation.from_euler("xyz", [rx, ry, rz]).as_matrix())  # Rz Ry Rx
    size = (int(width), int(height))
    return camera_from_pose(file, root.get("name", ""), size, matrix, rotation, np.array(translation), radial)


def _inverse_radial(kappa: float, reach: float) -> Floats:
    """k1, k2, 0, 0, k3, k4, k5, k6 of the lens that undoes r_u = r_d (1 + kappa r_d^2).

    Least squares of r_u N(r_u^2) / D(r_u^2) = r_d over distorted radii 0..reach, in focal lengths: linear rounds, each
    with the D of the last as weight; no further than the cubic rises, beyond which Tsai's model means nothing.
    """
    if kappa == 0:
        return np.zeros(5)
    reach = min(reach, _BEFORE_TURN / np.sqrt(-3 * kappa)) if kappa < 0 else reach
    distorted = np.linspace(0, reach, 400)[1:]
    plain = distorted * (1 + kappa * distorted**2)
    powers = plain[:, None] ** np.array([2, 4, 6])
    table = np.concatenate([plain[:, None] * powers, -distorted[:, None] * powers], axis=1)
    scale = np.ptp(table, axis=0)
    weight, found = np.ones_like(plain), np.zeros(6)
    for _ in range(_ROUNDS):
        found = np.linalg.lstsq(weight[:, None] * table / scale, weight * (distorted - plain))[0] / scale
        weight = 1 / (1 + powers @ found[3:])
    k1, k2, k3, k4, k5, k6 = found
    return np.array([k1, k2, 0.0, 0.0, k3, k4, k5, k6])


def _attributes(file: Path, root: ElementTree.Element, tag: str, names: str) -> list[float]:
    node = root.find(tag)
    if node is None:
        raise FormatError(file, tag, "no such node", f"one with {names}")
    words = [node.attrib.get(name, "") for name in names.split()]
    numbers = parse_numbers(words)
    if numbers is None:
        found = f"no finite number: {' '.join(words)[:60]}"
        raise FormatError(file, tag, found, f"numbers {names}")
    return numbers
