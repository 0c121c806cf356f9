"""Cameras given as 3x4 projection matrices: text, NumPy's .npy and .npz, MATLAB's .mat (HDF5 since version 7.3)."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from stseg.arrays import AnyArray, Floats
from stseg.errors import FormatError
from stseg.io.calibrations.foreign_camera import ForeignCamera

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
        file.stat()  # each reader has its own, unclear words for a missing file
        matrices = {key: array for key, array in reader(file).items() if array.shape == (3, 4)}
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, _EXPECTED) from error
    except (ValueError, EOFError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(file, "", f"what cannot be read ({error})", _EXPECTED) from error
    if len(matrices) != 1:
        names = f" ({', '.join(matrices)})" if matrices else ""
        raise FormatError(file, "", f"{len(matrices)} arrays of that shape{names}", _EXPECTED)
    ((key, matrix),) = matrices.items()
    if matrix.dtype.kind not in "iuf" or not np.isfinite(matrix).all():
        raise FormatError(file, key, "values that are not finite numbers", _EXPECTED)
    return ForeignCamera(file, "", None, matrix.astype(float))


def _read_text(file: Path) -> Mapping[str, Floats]:
    words = file.read_text(encoding="utf-8").replace(",", " ").split()
    numbers = np.array([float(word) for word in words])
    return {"": numbers.reshape(3, 4)} if len(numbers) == 12 else {}


def _read_npy(file: Path) -> Mapping[str, AnyArray]:
    return {"": np.asarray(np.lib.format.open_memmap(file, mode="r"))}


def _read_npz(file: Path) -> Mapping[str, AnyArray]:
    if not zipfile.is_zipfile(file):
        raise ValueError("not an .npz archive")
    with np.load(file, allow_pickle=False) as arrays:
        return {key: np.asarray(arrays[key]) for key in arrays.files}


def _read_mat(file: Path) -> Mapping[str, AnyArray]:
    if not h5py.is_hdf5(file):
        return {key: array for key, array in _read_old_mat(file).items() if not key.startswith("__")}
    with h5py.File(file, "r") as group:
        stored = {key: group[key] for key in group if isinstance(group.get(key), h5py.Dataset)}
        # MATLAB writes columns first, so HDF5 sees the transpose.
        return {key: np.asarray(array[()]).T for key, array in stored.items() if array.shape == (4, 3)}


def _read_old_mat(file: Path) -> Mapping[str, AnyArray]:
    try:
        return {key: np.asarray(array) for key, array in loadmat(file).items()}
    except (MatReadError, NotImplementedError, TypeError, struct.error) as error:
        raise ValueError(f"no .mat file: {error}") from error


_READERS: dict[str, Callable[[Path], Mapping[str, AnyArray]]] = {
    ".txt": _read_text,
    ".csv": _read_text,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".mat": _read_mat,
}
