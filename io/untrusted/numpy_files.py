"""NumPy's .npy and .npz, read within bounds: declared sizes are checked against the file before anything is allocated.

numpy.load evaluates headers as Python and allocates what they declare; here only arrays of plain numbers and texts are
read, from headers of the form that NumPy writes. Source: NEP 1, "A Simple File Format for NumPy Arrays".
"""

import math
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np

from stseg.arrays import AnyArray
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_bytes
from stseg.io.untrusted.values import abbreviated

_MAGIC = b"\x93NUMPY"
_HEADER = re.compile(
    r"\{'descr': '([<>|=]?(?:f[248]|[iu][1248]|b1)|[<>]U\d{1,4})', 'fortran_order': (True|False), "
    r"'shape': \(([\d, ]{0,100})\), \}\s*",
    re.ASCII,
)
_DIMENSIONS = 8


def parse_npy(data: bytes) -> AnyArray:
    """The array in the bytes of a .npy file; ValueError, of one line, where they are none."""
    if len(data) < 10 or data[:6] != _MAGIC or data[6] not in (1, 2, 3):
        raise ValueError("no .npy header")
    wide = data[6] > 1
    start = 12 if wide else 10
    length = int.from_bytes(data[8:start], "little")
    if length > limits.LINE or start + length > len(data):
        raise ValueError("a .npy header that is cut off")
    header = _HEADER.fullmatch(data[start : start + length].decode("latin-1"))
    if header is None:
        raise ValueError("a .npy header of another form than plain numbers have")
    dtype, shape = np.dtype(header[1]), _shape(header[3])
    body = memoryview(data)[start + length :]
    if not dtype.itemsize or math.prod(shape) * dtype.itemsize != len(body):
        raise ValueError(f"a .npy header of shape {shape} over {len(body)} bytes")
    return np.frombuffer(body, dtype).reshape(shape, order="F" if header[2] == "True" else "C")


def read_npy(path: Path, most: int = limits.UNPACKED) -> AnyArray:
    """The array of a .npy file of at most `most` bytes; raises OSError and ValueError."""
    return parse_npy(read_bytes(path, most))


def read_npz(path: Path, most: int = limits.UNPACKED) -> Mapping[str, AnyArray]:
    """The arrays of a .npz file by name, all together of at most `most` bytes, unpacked.

    OSError, ValueError where it is no such archive, or larger.
    """
    packed = BytesIO(read_bytes(path, most))
    arrays, rest = {}, most
    try:
        with zipfile.ZipFile(packed) as archive:
            members = archive.infolist()
            if len(members) > limits.MEMBERS:
                raise ValueError(f"{len(members)} members, more than {limits.MEMBERS}")
            for member in members:
                if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise ValueError("a member that is packed in another way than NumPy packs")
                with archive.open(member) as file:
                    data = file.read(rest + 1)
                if len(data) > rest:
                    raise ValueError(f"more than {most} bytes unpacked")
                rest -= len(data)
                arrays[member.filename.removesuffix(".npy")] = parse_npy(data)
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, struct.error) as error:
        raise ValueError(f"no .npz archive, or a broken one: {abbreviated(str(error))}") from error
    return arrays


def _shape(text: str) -> tuple[int, ...]:
    words = [word.strip() for word in text.split(",") if word.strip()]
    if len(words) > _DIMENSIONS or not all(word.isdecimal() and len(word) <= 12 for word in words):
        raise ValueError(f"a .npy header of shape ({text})")
    return tuple(int(word) for word in words)
