"""Camera matrix and lens of a camera from views of a checkerboard (Zhang, PAMI 22(11), 2000, as OpenCV has it)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats, even_rows
from stseg.errors import CalibrationError
from stseg.geometry import Lens

MIN_VIEWS = 8
"""Views of the board that a calibration needs."""
_MAX_VIEWS = 60
"""Views in use, spread over all that were found."""
_REFINE = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)


@dataclass(frozen=True)
class LensFit:
    """A calibrated lens."""

    lens: Lens
    error: float
    """Root mean square of the reprojection errors, pixels."""
    focal_deviation: float
    """Standard deviation of the focal length, pixels."""
    views: int
    """Number of views of the board."""


def find_corners(image: Bytes, board: tuple[int, int]) -> Floats | None:
    """Inner corners of a board of (columns, rows) of inner corners, float64 (n, 2); None where it is not whole."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, corners = cv2.findChessboardCorners(grey, board, flags=flags)
    if not found:
        return None
    return np.asarray(cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), _REFINE), float).reshape(-1, 2)


def fit_lens(name: str, corners: Sequence[Floats], board: tuple[int, int], size: tuple[int, int]) -> LensFit:
    """Fit the lens to the corners of several views of a board; it does not depend on the size of the squares.

    Parameters
    ----------
    name
        The camera's, for errors.
    corners
        `find_corners` of each view.
    board
        Columns and rows of inner corners.
    size
        Width and height of the images, pixels.

    Raises
    ------
    CalibrationError
        Where there are too few views.
    """
    if len(corners) < MIN_VIEWS:
        expected = f"at least {MIN_VIEWS}, tilted and all over the image (is --board the number of inner corners?)"
        raise CalibrationError(name, "checkerboard", f"{len(corners)} views of the whole board", expected)
    chosen = even_rows(len(corners), _MAX_VIEWS)
    grid = np.stack(np.meshgrid(np.arange(board[0]), np.arange(board[1])), -1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))]).astype(np.float32)
    pixels = [corners[k].astype(np.float32) for k in chosen]
    error, matrix, distortion, _, _, deviation, _, _ = cv2.calibrateCameraExtended(
        [points] * len(pixels), pixels, size, np.eye(3), np.zeros(5)
    )
    lens = Lens(np.asarray(matrix, float), np.asarray(distortion, float))
    return LensFit(lens, float(error), float(deviation[0, 0]), len(chosen))
