"""Numeric matrices of MATLAB's MAT-files, version 5, read within bounds.

scipy.io.loadmat crashes on some broken files; a calibration needs no more than real, two-dimensional numeric matrices
at the top level, and those take a page. Source: MAT-File Format, The MathWorks, R2023b, chapter 1.
"""

import zlib
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats
from stseg.io.untrusted import limits

_HEADER = 128
_COMPRESSED, _MATRIX, _NAME, _SIZES = 15, 14, 1, 5
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""NumPy's types by the numbers of MATLAB's."""
_NUMERIC = range(6, 16)
"""Classes of arrays that hold numbers: double, single and the integers."""
_COMPLEX = 0x08
_LARGEST = 1 << 16
"""Numbers of a matrix that are read."""


class _Element(NamedTuple):
    kind: int
    body: bytes


def parse_mat(data: bytes) -> Mapping[str, Floats]:
    """Real numeric matrices by name, float64 (rows, columns); arrays of other kinds are left out.

    ValueError where the bytes are no MAT-file of version 5; the message is one line.
    """
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        raise ValueError("no MAT-file of version 5 to 7.3 (MATLAB's -v6, -v7 or -v7.3)")
    order = "<" if data[126:128] == b"IM" else ">"
    matrices = {}
    for element in _elements(data[_HEADER:], order):
        if element.kind == _COMPRESSED:
            element = next(_elements(_inflated(element.body), order), _Element(0, b""))
        if element.kind == _MATRIX and (found := _matrix(element.body, order)) is not None:
            name, matrix = found
            matrices[name] = matrix
    return matrices


def _elements(data: bytes, order: str) -> Iterator[_Element]:
    """The elements one after the other; each is a tag of 8 bytes and its body, or a small one of 8 bytes in all."""
    at, endian = 0, "little" if order == "<" else "big"
    while at + 8 <= len(data):
        word = int.from_bytes(data[at : at + 4], endian)  # type: ignore[arg-type]  # little or big
        kind, size, start = word, int.from_bytes(data[at + 4 : at + 8], endian), at + 8  # type: ignore[arg-type]
        small = word >> 16
        if small:
            kind, size, start = word & 0xFFFF, small, at + 4
        if start + size > len(data) or (small and size > 4):
            raise ValueError(f"an element of {size} bytes, where {len(data) - start} are left")
        yield _Element(kind, data[start : start + size])
        at = at + 8 if small else start + (size if kind == _COMPRESSED else -(-size // 8) * 8)


def _inflated(packed: bytes) -> bytes:
    unpack = zlib.decompressobj()
    try:
        data = unpack.decompress(packed, limits.UNPACKED)
    except zlib.error as error:
        raise ValueError(f"a broken element ({error})") from error
    if unpack.unconsumed_tail:
        raise ValueError(f"an element of more than {limits.UNPACKED} bytes")
    return data


def _matrix(body: bytes, order: str) -> tuple[str, Floats] | None:
    """Name and values of an array; None where it is no real matrix of numbers."""
    parts = _elements(body, order)
    flags, sizes, name, values = (next(parts, _Element(0, b"")) for _ in range(4))
    if len(flags.body) < 4 or sizes.kind != _SIZES or name.kind != _NAME:
        return None
    word = int.from_bytes(flags.body[:4], "little" if order == "<" else "big")
    shape = np.frombuffer(sizes.body[: len(sizes.body) // 4 * 4], f"{order}i4").tolist()
    if word & 0xFF not in _NUMERIC or word >> 8 & _COMPLEX or len(shape) != 2 or values.kind not in _TYPES:
        return None
    dtype = np.dtype(f"{order}{_TYPES[values.kind]}")
    count = shape[0] * shape[1]
    if min(shape) < 1 or count > _LARGEST or len(values.body) != count * dtype.itemsize:
        return None
    matrix = np.frombuffer(values.body, dtype).astype(float).reshape(shape, order="F")
    return name.body.decode("latin-1")[: limits.NAME], matrix
