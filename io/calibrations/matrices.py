"""Cameras given as matrices: 3x4 projections, and EPFL's (POM's) pairs of homographies.

Projections: text, NumPy's .npy and .npz, MATLAB's .mat (HDF5 since version 7.3). POM: per camera the homographies from
the image to the ground plane and to the head plane. Both lead to cells of the same ground grid, whose side is the
world's unit; its rows often count downwards, which makes the world left-handed.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from stseg.arrays import AnyArray, Floats
from stseg.errors import CalibrationError, FormatError
from stseg.geometry.fits import fit_vertical, homogeneous
from stseg.io.calibrations.foreign_camera import ForeignCamera
from stseg.io.calibrations.matlab_file import parse_mat
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_bytes, read_text, reading
from stseg.io.untrusted.numpy_files import read_npy, read_npz
from stseg.io.untrusted.safe_hdf5 import open_hdf5, read_whole
from stseg.io.untrusted.values import parse_numbers

_PROJECTION = "one 3x4 projection matrix"
_PLANES = "two 3x3 matrices, image to ground plane and image to head plane, a row a line"
_SAMPLES = 9  # pixels along each side of the image at which the head plane is sampled


def read_projection(files: Sequence[Path]) -> list[ForeignCamera]:
    """One camera a file, from the one 3x4 matrix in it; FormatError where it does not hold exactly one.

    The suffix says the format: .txt or .csv (twelve numbers, row by row, with blanks or commas), .npy, .npz, .mat.
    """
    return [_read(file) for file in files]


def _read(file: Path) -> ForeignCamera:
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise FormatError(file, "", f"the suffix {file.suffix!r}", f"one of {', '.join(_READERS)}")
    try:
        matrices = {key: array for key, array in reader(file).items() if array.shape == (3, 4)}
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, _PROJECTION) from error
    except ValueError as error:
        raise FormatError(file, "", f"what cannot be read ({error})", _PROJECTION) from error
    if len(matrices) != 1:
        names = f" ({', '.join(matrices)})" if matrices else ""
        raise FormatError(file, "", f"{len(matrices)} arrays of that shape{names}", _PROJECTION)
    ((key, matrix),) = matrices.items()
    if matrix.dtype.kind not in "iuf" or not (np.abs(matrix) <= limits.NUMBER).all():
        raise FormatError(file, key, "numbers that are not finite, or not of usual size", _PROJECTION)
    return ForeignCamera(file, "", None, matrix.astype(float))


def _read_text(file: Path) -> Mapping[str, Floats]:
    words = read_text(file).replace(",", " ").split()
    if len(words) != 12:
        return {}
    numbers = parse_numbers(words)
    if numbers is None:
        raise ValueError("a word that is no finite number")
    return {"": np.array(numbers).reshape(3, 4)}


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
    ".npy": lambda file: {"": read_npy(file)},
    ".npz": read_npz,
    ".mat": _read_mat,
}


def read_pom(files: Sequence[Path], size: tuple[int, int], head: float) -> list[ForeignCamera]:
    """One camera of an image `size` (width, height), pixels.

    The head plane is `head` sides of the ground's cells high. The files are a text with the ground homography and
    then the head homography, or one of each. Lines of three numbers are read (brackets, commas and semicolons count
    as blanks), all others ignored. FormatError where there are not two matrices; CalibrationError where they are no
    planes that a camera sees.
    """
    rows = [row for file in files for row in _rows(file)]
    names = " + ".join(map(str, files))
    if len(rows) != 6:
        raise FormatError(names, "", f"{len(rows)} lines of three numbers", _PLANES)
    ground, heads = np.array(rows[:3]), np.array(rows[3:])
    pixel = np.stack(np.meshgrid(*(np.linspace(0, side - 1, _SAMPLES) for side in size)), -1).reshape(-1, 2)
    try:
        homography, to_head = np.linalg.inv(ground), np.linalg.inv(heads)
    except np.linalg.LinAlgError as error:
        raise CalibrationError(names, "homography", "a singular matrix", "one that can be inverted") from error
    # The lower edge of an image shows the ground, if anything does.
    foot = homogeneous(np.array([(size[0] - 1) / 2, size[1] - 1.0])) @ ground.T
    homography = homography * np.sign(float(homography[2] @ (foot / foot[2])))
    image = homogeneous(pixel) @ ground.T
    place = image[:, :2] / image[:, 2:]
    visible = homogeneous(place) @ homography[2] > 0
    image = homogeneous(place[visible]) @ to_head.T
    if visible.sum() < _SAMPLES:
        raise CalibrationError(names, "homography", "a ground plane that the image hardly shows", "one that it does")
    above = image[:, :2] / image[:, 2:]
    vertical = fit_vertical(homography, place[visible], np.full(int(visible.sum()), head), above)
    projection = np.column_stack([homography[:, :2], vertical, homography[:, 2]])
    return [ForeignCamera(files[0], "", size, projection)]


def _rows(file: Path) -> list[list[float]]:
    with reading(file, _PLANES):
        text = read_text(file)
    lines = map(str.split, text.translate(str.maketrans("[](){},;", " " * 8)).splitlines())
    return [row for words in lines if len(words) == 3 and (row := parse_numbers(words)) is not None]
