"""Lenses of files: what is wrong with their numbers is said with the file and the key."""

from collections.abc import Callable

from stseg.arrays import Floats
from stseg.errors import CalibrationError, InputError
from stseg.geometry.lens import Lens, LensModel


def checked_lens(
    matrix: Floats, distortion: Floats, model: LensModel, error: Callable[[str, object, str], InputError]
) -> Lens:
    """A lens of a camera matrix (3, 3) and coefficients (n,).

    Coefficients beyond the model's must be zero. `error` makes the error of a key (matrix, distortion), the value found
    and the value expected.
    """
    try:
        return Lens(matrix, distortion, model)
    except CalibrationError as wrong:
        raise error(wrong.key, wrong.found, wrong.expected) from None
