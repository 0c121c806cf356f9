"""Cameras given as 3x4 projection matrices: text, NumPy's .npy and .npz, MATLAB's .mat of version 7.3 (HDF5)."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np

from stseg.arrays import AnyArray, Floats
from stseg.errors import FormatError
from stseg.geometry import Camera
from stseg.io.calibrations.world import World

_EXPECTED = "one 3x4 projection matrix"


def read_projection(file: Path, name: str, size: tuple[int, int], world: World) -> Camera:
    """One camera from the one 3x4 matrix in a file.

    Parameters
    ----------
    file
        Its suffix says the format: .txt or .csv (twelve numbers, row by row, with blanks or commas), .npy, .npz,
        .mat (version 7.3).
    name, size
        Of the camera; the file does not tell.
    world
        Unit and upward axis of the points that the matrix projects.

    Raises
    ------
    FormatError
        Where the file does not hold exactly one such matrix.
    CalibrationError
        Where the matrix is no camera's.
    """
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
    return world.camera(file, name, size, matrix.astype(float))


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
        raise ValueError("older than version 7.3: save it with '-v7.3', or as text")
    with h5py.File(file, "r") as group:
        stored = {key: group[key] for key in group if isinstance(group.get(key), h5py.Dataset)}
        # MATLAB writes columns first, so HDF5 sees the transpose.
        return {key: np.asarray(array[()]).T for key, array in stored.items() if array.shape == (4, 3)}


_READERS: dict[str, Callable[[Path], Mapping[str, AnyArray]]] = {
    ".txt": _read_text,
    ".csv": _read_text,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".mat": _read_mat,
}
