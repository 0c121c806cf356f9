"""Projection by other means: a 3x4 matrix, and OpenCV's own function."""

import cv2
import numpy as np

from stseg.arrays import Floats
from stseg.geometry.lens import LensModel


def project_by_matrix(projection: Floats, points: Floats) -> Floats:
    """Pixels (n, 2) of points (n, 3) under a 3x4 matrix."""
    image = np.column_stack([points, np.ones(len(points))]) @ projection.T
    return np.asarray(image[:, :2] / image[:, 2:])


def project_by_opencv(
    matrix: Floats,
    distortion: Floats,
    rotation_vector: Floats,
    translation: Floats,
    points: Floats,
    model: LensModel = "pinhole",
) -> Floats:
    """Pixels (n, 2) of points (n, 3) in the calibration's own world and unit."""
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    pixels, _ = project(np.ascontiguousarray(points[None], float), rotation_vector, translation, matrix, distortion)
    return np.asarray(pixels, float).reshape(-1, 2)


def matrix_of(matrix: Floats, rotation_vector: Floats, translation: Floats) -> Floats:
    """K [R | t], float64 (3, 4)."""
    rotation, _ = cv2.Rodrigues(np.asarray(rotation_vector, float))
    return np.asarray(matrix @ np.column_stack([rotation, translation]), float)
