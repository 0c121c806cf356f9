"""Mutations of files: bytes, text and HDF5."""

import re
from collections.abc import Callable
from io import BytesIO
from typing import Any

import h5py
import numpy as np

_WORDS = (
    *(b"1e308", b"-1e308", b"1e-308", b"nan", b"inf", b"-1", b"0", b"9" * 400, b"9" * 5000, b"18446744073709551616"),
    *(b"2147483648", b"0x7f", b"1_0", b"null", b"[]", b"{}", b'""', b"true", b"\xd9\xa3", b"\x00", b"\xff\xfe"),
    *(b"../../x", b"/", b"..", b"http://127.0.0.1:9/", b"\x1b[31m", b"[" * 2000, b"a." * 3000, b"," * 3000),
)
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_BINARY = (0, 1, 0x7F, 0x80, 0xFF, 0xFE)


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """A copy with one to five mutations."""
    for _ in range(random.integers(1, 6)):
        data = _MUTATIONS[random.integers(len(_MUTATIONS))](data, random)
    return data


def _flip(data: bytes, random: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for place in random.integers(0, max(1, len(data)), min(len(data), int(random.integers(1, 9)))):
        changed[place] ^= 1 << int(random.integers(8))
    return bytes(changed)


def _set(data: bytes, random: np.random.Generator) -> bytes:
    changed = bytearray(data)
    if data:
        start = int(random.integers(len(data)))
        length = int(random.choice([1, 2, 4, 8]))
        changed[start : start + length] = bytes([int(random.choice(_BINARY))]) * length
    return bytes(changed)


def _cut(data: bytes, random: np.random.Generator) -> bytes:
    return data[: int(random.integers(len(data) + 1))]


def _remove(data: bytes, random: np.random.Generator) -> bytes:
    start, length = int(random.integers(len(data) + 1)), int(random.integers(1, 40))
    return data[:start] + data[start + length :]


def _double(data: bytes, random: np.random.Generator) -> bytes:
    start, length = int(random.integers(len(data) + 1)), int(random.integers(1, 200))
    return data[:start] + data[start : start + length] * int(random.integers(2, 20)) + data[start + length :]


def _insert(data: bytes, random: np.random.Generator) -> bytes:
    start = int(random.integers(len(data) + 1))
    return data[:start] + _WORDS[random.integers(len(_WORDS))] + data[start:]


def _number(data: bytes, random: np.random.Generator) -> bytes:
    """A number in a text replaced by one at which parsers break."""
    numbers = list(_NUMBER.finditer(data[:100_000]))
    if not numbers:
        return _set(data, random)
    found = numbers[random.integers(len(numbers))]
    return data[: found.start()] + _WORDS[random.integers(len(_WORDS))] + data[found.end() :]


_MUTATIONS = (_flip, _set, _cut, _remove, _double, _insert, _number, _number)


_REALS = (np.nan, np.inf, -1e30, 1e30, 0.0, -1.0)
_ATTRIBUTES: tuple[Any, ...] = (np.nan, -1, 1e308, "x" * 10_000, b"\xff", np.arange(9), "", 2**62, "\x1b[31m")


def mutated_objects(data: bytes, random: np.random.Generator) -> bytes:
    """A copy with one to three mutations."""
    file = BytesIO(data)
    with h5py.File(file, "r+") as root:
        for _ in range(random.integers(1, 4)):
            names: list[str] = []
            root.visit(names.append)
            if names:
                _OBJECT_MUTATIONS[random.integers(len(_OBJECT_MUTATIONS))](
                    root, names[random.integers(len(names))], random
                )
    return file.getvalue()


def _remove_object(root: h5py.File, name: str, random: np.random.Generator) -> None:
    del root[name]
    if random.integers(2):
        root.create_group(name)


def _rename(root: h5py.File, name: str, random: np.random.Generator) -> None:
    root.move(name, f"moved{random.integers(1 << 30)}")


def _other_array(root: h5py.File, name: str, random: np.random.Generator) -> None:
    """The same object with another type or shape; its attributes stay."""
    if not isinstance(root[name], h5py.Dataset):
        return
    values, attributes = root[name][...], dict(root[name].attrs)
    forms: tuple[Any, ...] = (
        values.astype(float) if values.dtype.kind in "iuf" else b"x",
        values.reshape(-1),
        values[:1] if values.ndim else values,
        7,
        np.zeros((3, 3, 3, 3, 3)),
        np.array([b"x" * 500]),
        "x" * 3000,
    )
    del root[name]
    root[name] = forms[random.integers(len(forms))]
    root[name].attrs.update(attributes)


def _value(root: h5py.File, name: str, random: np.random.Generator) -> None:
    """One value of an array or of a table's column."""
    found = root[name]
    if not isinstance(found, h5py.Dataset) or not found.size or found.dtype.kind in "OS":
        return
    values = np.atleast_1d(found[...])
    columns = values.dtype.names
    column = values if columns is None else values[columns[random.integers(len(columns))]]
    if column.dtype.kind == "f":
        column.flat[random.integers(column.size)] = _REALS[random.integers(len(_REALS))]
    elif column.dtype.kind in "iu":
        ends = np.iinfo(column.dtype)
        column.flat[random.integers(column.size)] = (ends.min, ends.max, 0, 1)[random.integers(4)]
    elif column.dtype.kind == "S":
        column.flat[random.integers(column.size)] = b"\xff<\x01"
    found[...] = values.reshape(found.shape)


def _attribute(root: h5py.File, name: str, random: np.random.Generator) -> None:
    owner = root[name] if random.integers(2) else root
    keys = sorted(owner.attrs)
    if keys:
        owner.attrs[keys[random.integers(len(keys))]] = _ATTRIBUTES[random.integers(len(_ATTRIBUTES))]


_OBJECT_MUTATIONS: tuple[Callable[[h5py.File, str, np.random.Generator], None], ...] = (
    _remove_object,
    _rename,
    _other_array,
    _value,
    _value,
    _attribute,
)
