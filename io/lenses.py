"""Lenses of files: their numbers are checked once for all formats."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stseg.arrays import Floats
from stseg.errors import InputError
from stseg.geometry.lens import COEFFICIENTS, Lens, LensModel


def checked_lens(
    matrix: Floats, distortion: Floats, model: LensModel, error: Callable[[str, object, str], InputError]
) -> Lens:
    """A lens of a camera matrix (3, 3) and coefficients (n,).

    Coefficients beyond the model's must be zero. `error` makes the error of a key (matrix, distortion), the value found
    and the value expected.
    """
    if min(matrix[0, 0], matrix[1, 1]) <= 0 or matrix[1, 0] != 0 or matrix[2].tolist() != [0, 0, 1]:
        raise error("matrix", matrix.tolist(), "a camera matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]]")
    names, used = COEFFICIENTS[model], np.trim_zeros(distortion, "b")
    if len(used) > len(names):
        raise error("distortion", f"{len(distortion)} coefficients", f"at most {len(names)}: {', '.join(names)}")
    return Lens(matrix, used, model)
