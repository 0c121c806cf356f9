"""Global heaps of an HDF5 file, checked before HDF5 walks through them.

Texts of any length stand in global heap collections (HDF5 File Format Specification 3.0, section III.E): a header of 16
bytes, then objects, each with a header of 16 bytes, and at the end the free space as object 0. HDF5 trusts the size of
the free space; where that is false, it walks on the spot without end and cannot be interrupted.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from stseg.io.untrusted import limits

_SIGNATURE = b"GCOL\x01\x00\x00\x00"
_HEADER = 16
"""Bytes of a collection's header, and of each object's, where addresses and lengths have 8 bytes."""
_BLOCK = 1 << 24


def require_sound_heaps(path: Path) -> None:
    """Raise ValueError, in one line, where a global heap of a file would not be left again.

    The bytes of the whole file are searched, so that a collection is found wherever a text claims to stand.
    """
    with path.open("rb") as file:
        end = 0
        for start in _collections(file):
            if start < end:
                raise ValueError(f"a global heap at byte {start} inside of another")
            file.seek(start)
            end = start + _size_of_collection(file, start)


def _collections(file: BinaryIO) -> Iterator[int]:
    """Places of all signatures; blocks overlap by what a signature may stand astride."""
    place = 0
    while len(block := _block(file, place)) >= len(_SIGNATURE):
        found = block.find(_SIGNATURE)
        while found >= 0:
            yield place + found
            found = block.find(_SIGNATURE, found + 1)
        place += len(block) - len(_SIGNATURE) + 1


def _block(file: BinaryIO, place: int) -> bytes:
    file.seek(place)
    return file.read(_BLOCK)


def _size_of_collection(file: BinaryIO, start: int) -> int:
    """Bytes of the collection that begins here; ValueError where its objects do not lead to its end."""
    header = file.read(_HEADER)
    size = struct.unpack_from("<Q", header, 8)[0] if len(header) == _HEADER else 0
    if not _HEADER <= size <= limits.UNPACKED:
        raise ValueError(f"a global heap at byte {start} of {size} bytes, expected {_HEADER} to {limits.UNPACKED}")
    collection = header + file.read(size - _HEADER)
    if len(collection) < size:
        raise ValueError(f"a global heap at byte {start} of {size} bytes, more than the file has")
    place = _HEADER
    while size - place >= _HEADER:
        index, length = struct.unpack_from("<H6xQ", collection, place)
        if index == 0 and length != size - place:
            raise ValueError(f"a global heap at byte {start}: {length} bytes free, found room for {size - place}")
        place += length if index == 0 else _HEADER + -(-length // 8) * 8
    if place > size:
        raise ValueError(f"a global heap at byte {start}: an object passes its end")
    return size
