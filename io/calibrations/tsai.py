"""Tsai's camera model as the XML of PETS 2009 writes it: lengths in millimetres, one radial coefficient.

R. Y. Tsai, A versatile camera calibration technique, IEEE J. Robotics and Automation 3(4), 1987. A ray through the
undistorted sensor point X_u = f x / z shows at X_d with X_u = X_d (1 + kappa1 |X_d|^2), and that at pixel
u = s_x X_d / d_px + c_x, v = Y_d / d_py + c_y. Our lens runs the other way, from undistorted to distorted, so its
radial coefficients (the rational form: a polynomial does not follow a strong lens) are fitted to the inverse.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stseg.arrays import Floats
from stseg.errors import FormatError
from stseg.io.calibrations.foreign_camera import ForeignCamera, camera_from_pose
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_xml
from stseg.io.untrusted.values import parse_numbers, printable

_BEFORE_TURN = 0.9
"""Share of the radius at which the cubic turns round up to which it is followed."""
_ROUNDS = 3


def read_tsai_xml(files: Sequence[Path]) -> list[ForeignCamera]:
    """One camera a file, `<Camera>` with `<Geometry>`, `<Intrinsic>` and `<Extrinsic>`.

    Raises
    ------
    FormatError
        Where a file is no such XML, or a number is missing or none.
    """
    return [_read(file) for file in files]


def _read(file: Path) -> ForeignCamera:
    root = parse_xml(file, "XML of a Tsai calibration")
    width, height, dpx, dpy = _numbers(file, root, "Geometry", "width height dpx dpy")
    focal, kappa, cx, cy, sx = _numbers(file, root, "Intrinsic", "focal kappa1 cx cy sx")
    *translation, rx, ry, rz = _numbers(file, root, "Extrinsic", "tx ty tz rx ry rz")
    if min(width, height, dpx, dpy, focal, sx) <= 0:
        raise FormatError(file, "Geometry, Intrinsic", "a length that is not above 0", "lengths above 0")
    if min(width, height) < 1 or width * height > limits.PIXELS:
        raise FormatError(
            file, "Geometry", f"{width:g} x {height:g} pixels", f"an image of at most {limits.PIXELS:.0e}"
        )
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


def _numbers(file: Path, root: ElementTree.Element, tag: str, names: str) -> list[float]:
    node = root.find(tag)
    if node is None:
        raise FormatError(file, tag, "no such node", f"one with {names}")
    words = [node.attrib.get(name, "") for name in names.split()]
    numbers = parse_numbers(words)
    if numbers is None:
        found = f"no finite number: {printable(' '.join(words))[:60]}"
        raise FormatError(file, tag, found, f"numbers {names}")
    return numbers
