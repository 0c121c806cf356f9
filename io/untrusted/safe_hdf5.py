"""HDF5 files from outside: opened without links, storage, filters or references that lead out of the file.

An HDF5 file may name other files (external links, external storage, virtual datasets) and would show their contents as
its own. Sizes are checked before anything is read: what a dataset declares must have been stored in the file.

Texts of any length stand in global heap collections (HDF5 File Format Specification 3.0, section III.E): a header of 16
bytes, then objects, each with a header of 16 bytes, and at the end the free space as object 0. HDF5 trusts the size of
the free space; where that is false, it walks on the spot without end and cannot be interrupted.
So heaps are checked first.
"""

import errno
import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO, Literal

import h5py
import numpy as np
from h5py import h5z

from stseg.arrays import AnyArray
from stseg.io.untrusted import limits

_FILTERS = frozenset((h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32, h5z.FILTER_SCALEOFFSET))
"""Filters of HDF5 itself; any other would be loaded as a library from a folder of plug-ins."""
_PACKED = 1100
"""Most bytes that one stored byte unpacks to: deflate reaches 1032."""
_DEEPEST = 8
_CHUNK = 1 << 29
"""Bytes of one chunk, which HDF5 unpacks at once."""
_SIGNATURE = b"GCOL\x01\x00\x00\x00"
_HEADER = 16
"""Bytes of a collection's header, and of each object's, where addresses and lengths have 8 bytes."""
_BLOCK = 1 << 24


def hdf5_file(path: Path | str, mode: Literal["r", "r+"]) -> h5py.File:
    """An HDF5 file, locked where its file system has locks; raises OSError."""
    try:
        return h5py.File(path, mode)
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP):
            raise
    return h5py.File(path, mode, locking=False)


@contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file, open for reading, all of whose objects stand in it.

    OSError where it cannot be read; ValueError where it leads out of itself, has too many objects, or heaps without an
    end; the message is one line.
    """
    if not path.is_file():
        raise FileNotFoundError(2, "no such file", str(path))
    state = path.stat()
    try:
        _examine(path, state.st_ino, state.st_size, state.st_mtime_ns)
        with hdf5_file(path, "r") as file:
            yield file
    except (RuntimeError, KeyError, TypeError, AttributeError, OverflowError) as error:  # h5py, of broken files
        raise ValueError(str(error)[:200]) from error


@lru_cache(maxsize=64)
def _examine(path: Path, _inode: int, _size: int, _modified: int) -> None:
    """Raise what `open_hdf5` raises of a whole file: once in a process, and again when the file has changed."""
    require_sound_heaps(path)
    with hdf5_file(path, "r") as file:
        _require_known_sizes(file)
        _require_own(file)


def read_whole(dataset: h5py.Dataset, most: int = limits.UNPACKED) -> AnyArray:
    """All of a dataset of numbers; ValueError where it is none, or larger than it is stored."""
    require_stored(dataset, most)
    if dataset.dtype.kind not in "iufSbV" or dataset.dtype.hasobject:
        raise ValueError(f"{dataset.name}: values of type {dataset.dtype}")
    return np.asarray(dataset[()])


def require_stored(dataset: h5py.Dataset, most: int) -> None:
    """Raise ValueError where a dataset declares more than `most` bytes, or more than was ever written."""
    declared = math.prod(map(int, dataset.shape or ())) * dataset.dtype.itemsize
    if declared > most:
        raise ValueError(f"{dataset.name}: {declared} bytes, more than {most}")
    if declared > _PACKED * (dataset.id.get_storage_size() + 64):
        raise ValueError(f"{dataset.name}: {declared} bytes declared, {dataset.id.get_storage_size()} stored")


def _require_known_sizes(file: h5py.File) -> None:
    """Addresses and lengths of 8 bytes, as every library of today writes: no other heaps are checked."""
    sizes = file.id.get_create_plist().get_sizes()
    if sizes != (8, 8):
        raise ValueError(f"addresses and lengths of {sizes} bytes, expected 8 and 8")


def _require_own(file: h5py.File) -> None:
    """Visit every link and dataset once, without following links of other kinds."""
    waiting, count = [("/", file, 0)], 0
    while waiting:
        place, group, depth = waiting.pop()
        for name in group:
            count += 1
            key = f"{place}{name}"
            if count > limits.MEMBERS or depth > _DEEPEST:
                raise ValueError(f"{key}: more than {limits.MEMBERS} objects, or groups nested too deeply")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise ValueError(f"{key}: a link that leads elsewhere")
            kind = group.get(name, getclass=True)
            if kind is h5py.Group:
                waiting.append((f"{key}/", group[name], depth + 1))
            elif kind is h5py.Dataset:
                _require_own_storage(key, group[name])


def _require_own_storage(key: str, dataset: h5py.Dataset) -> None:
    properties = dataset.id.get_create_plist()
    if properties.get_external_count() or dataset.is_virtual:
        raise ValueError(f"{key}: values that stand in another file")
    filters = {properties.get_filter(index)[0] for index in range(properties.get_nfilters())}
    if not filters <= _FILTERS:
        raise ValueError(f"{key}: packed with filters {sorted(filters - _FILTERS)}")
    if dataset.chunks is not None and math.prod(dataset.chunks) * dataset.dtype.itemsize > _CHUNK:
        raise ValueError(f"{key}: chunks of {math.prod(dataset.chunks) * dataset.dtype.itemsize} bytes")


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
    while file.seek(place) == place and len(block := file.read(_BLOCK)) >= len(_SIGNATURE):
        found = block.find(_SIGNATURE)
        while found >= 0:
            yield place + found
            found = block.find(_SIGNATURE, found + 1)
        place += len(block) - len(_SIGNATURE) + 1


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
