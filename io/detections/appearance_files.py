"""Appearance features of detections, read from .npy files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stseg.arrays import Singles
from stseg.errors import FormatError, SourceError
from stseg.io.untrusted import limits
from stseg.io.untrusted.numpy_files import read_npy

_EXPECTED = "a .npy array of numbers, one row a detection"


def read_features(path: Path, detections: int) -> Singles:
    """Features of the detections of one file, in its order, float32 (detection, feature).

    Raises
    ------
    SourceError, FormatError
        Where the file cannot be read, or has another number of rows, or numbers that are not finite.
    """
    try:
        array = read_npy(path)
    except OSError as error:
        raise SourceError(path, "", error.strerror or error, _EXPECTED) from error
    except ValueError as error:
        raise FormatError(path, "", error, _EXPECTED) from error
    if array.ndim != 2 or array.dtype.kind not in "fiu" or not 1 <= array.shape[1] <= limits.FEATURES:
        raise FormatError(path, "", f"an array of {array.dtype} {array.shape}", _EXPECTED)
    if len(array) != detections:
        raise FormatError(path, "", f"{len(array)} rows", f"{detections}, one a detection")
    if not (np.abs(array.astype(np.float64)) <= limits.NUMBER).all():
        raise FormatError(path, "", "a number that is not finite, or huge", "finite numbers of usual size")
    return array.astype(np.float32)
