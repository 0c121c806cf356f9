"""Cameras given as 3x4 projection matrices: text, NumPy's .npy and .npz, MATLAB's .mat (HDF5 since version 7.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from stseg.arrays import AnyArray, Floats
from stseg.errors import FormatError
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.matlab_file import parse_mat
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_bytes, read_text
from stseg.io.untrusted.numbers import parse_numbers
from stseg.io.untrusted.numpy_files import read_npy, read_npz
from stseg.io.untrusted.safe_hdf5 import open_hdf5, read_whole

_EXPECTED = "one 3x4 projection matrix"


def read_projection(files: Sequence[Path]) -> list[ForeignCamera]:
    """One camera a file, from the one 3x4 matrix in it.

    Parameters
    ----------
    files
        The suffix says the format: .txt or .csv (twelve numbers, row by row, with blanks or commas), .npy, .npz, .mat.

    Raises
    ------
    FormatError
        Where a file does not hold exactly one such matrix.
    """
    return [_read(file) for file in files]


def _read(file: Path) -> ForeignCamera:
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise FormatError(file, "", f"the suffix {file.suffix!r}", f"one of {', '.join(_READERS)}")
    try:
        matrices = {key: array for key, array in reader(file).items() if array.shape == (3, 4)}
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, _EXPECTED) from error
    except ValueError as error:
        raise FormatError(file, "", f"what cannot be read ({error})", _EXPECTED) from error
    if len(matrices) != 1:
        names = f" ({', '.join(matrices)})" if matrices else ""
        raise FormatError(file, "", f"{len(matrices)} arrays of that shape{names}", _EXPECTED)
    ((key, matrix),) = matrices.items()
    if matrix.dtype.kind not in "iuf" or not (np.abs(matrix) <= limits.NUMBER).all():
        raise FormatError(file, key, "values that are no finite numbers of usual size", _EXPECTED)
    return ForeignCamera(file, "", None, matrix.astype(float))


def _read_text(file: Path) -> Mapping[str, Floats]:
    words = read_text(file).replace(",", " ").split()
    if len(words) != 12:
        return {}
    numbers = parse_numbers(words)
    if numbers is None:
        raise ValueError("a word that is no finite number")
    return {"": np.array(numbers).reshape(3, 4)}


def _read_npy(file: Path) -> Mapping[str, AnyArray]:
    return {"": read_npy(file)}


def _read_mat(file: Path) -> Mapping[str, AnyArray]:
    data = read_bytes(file, limits.UNPACKED)
    if data[:8] != b"\x89HDF\r\n\x1a\n" and data[512:520] != b"\x89HDF\r\n\x1a\n":
        return parse_mat(data)
    with open_hdf5(file) as group:
        stored = {key: group[key] for key in group if isinstance(group.get(key), h5py.Dataset)}
        # MATLAB writes columns first, so HDF5 sees the transpose.
        return {key: read_whole(array).T for key, array in stored.items() if array.shape == (4, 3)}


_READERS: dict[str, Callable[[Path], Mapping[str, AnyArray]]] = {
    ".txt": _read_text,
    ".csv": _read_text,
    ".npy": _read_npy,
    ".npz": read_npz,
    ".mat": _read_mat,
}
