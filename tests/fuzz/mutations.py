"""Mutations of files: bytes; words and elements of texts; objects of HDF5.

Bytes break the form of most files, so that readers go no further. What keeps the form comes as far as their checks:
every limit and what is just beyond it, words in the place of others, elements that are missing, twice or too many.
"""

import re
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import h5py
import numpy as np

from stseg.io.untrusted import limits

_WORDS = (
    *(b"1e308", b"-1e308", b"1e-308", b"nan", b"inf", b"-1", b"0", b"9" * 400, b"9" * 5000, b"18446744073709551616"),
    *(b"2147483648", b"0x7f", b"1_0", b"null", b"[]", b"{}", b'""', b"true", b"\xd9\xa3", b"\x00", b"\xff\xfe"),
    *(b"../../x", b"/", b"..", b"http://127.0.0.1:9/", b"\x1b[31m", b"[" * 2000, b"a." * 3000, b"," * 3000),
)
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_LIMITS = [one for _, found in sorted(vars(limits).items()) for one in np.ravel(found) if isinstance(one, np.number)]
_BOUNDS = (
    *(b"%s%d" % (sign, int(limit) + more) for limit in _LIMITS for sign in (b"", b"-") for more in (0, 1)),
    *(b"%r" % float(limit * share) for limit in _LIMITS for share in (0.5, 1.001)),
    *(b"-1", b"0", b"1", b"2", b"3", b"7", b"0.5", b"-0.5", b"1.5", b"1e-320", b"1e13", b"400", b"1.0", b"nan", b"inf"),
)
_TEXTS = (
    *(b"", b" ", b" a", b"a/b", b"..", b"a\\\\b", b"a\\u001b[31m", b"a\\u0000b", b"x" * 99, b"x" * 101),
    *(b"\xc3\xa9" * 99, b"x" * 300, b"a/" * 3000, b"=1+1", b"1", b"-1", b"strange", b"http://127.0.0.1:9/"),
)
_TEXT = re.compile(rb"(?<=\")[^\"\n]*(?=\")|(?<![^,\n])[A-Za-z_]\w*(?![^,\n])")
_WORD = re.compile(rb'"[^"\n]*"|[^\s,;:=<>()\[\]{}"]+')
_SPANS = (
    re.compile(rb"(?m)^.*\n?"),  # lines
    re.compile(rb'\s[\w-]+ ?= ?"[^"]*"|<(\w+)\b[^>]*>[^<]*</\1>|<[^>]*/>'),  # attributes and elements of XML
    re.compile(rb"[^,\[\]{}\n]+,?|\[[^\[\]]*\],?|\{[^{}]*\},?"),  # between commas, in brackets
)
_MANY = (2, 2, 2, 3, 257, 1_001, 2_001, 10_001, 20_001)
Mutation = Callable[[bytes, np.random.Generator], bytes]
_BINARY = (0, 1, 0x7F, 0x80, 0xFF, 0xFE)


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """A copy with one to five mutations of any kind; of every two, one has a single mutation that keeps the form."""
    if random.integers(2):
        return _FORMED[random.integers(len(_FORMED))](data, random)
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


def _insert(data: bytes, random: np.random.Generator) -> bytes:
    start = int(random.integers(len(data) + 1))
    return data[:start] + _WORDS[random.integers(len(_WORDS))] + data[start:]


def _found(pattern: re.Pattern[bytes], data: bytes, random: np.random.Generator) -> tuple[int, int]:
    """The place of one of what a pattern finds; an empty one at the end of where it finds nothing."""
    spans = [found.span() for found in pattern.finditer(data[:100_000]) if found[0] or pattern is _TEXT]
    return spans[random.integers(len(spans))] if spans else (len(data), len(data))


def _in_place(pattern: re.Pattern[bytes], words: Sequence[bytes]) -> Mutation:
    def replaced(data: bytes, random: np.random.Generator) -> bytes:
        start, stop = _found(pattern, data, random)
        return data[:start] + words[int(random.integers(len(words)))] + data[stop:]

    return replaced


def _exchange(data: bytes, random: np.random.Generator) -> bytes:
    """A word, or an element, in the place of another."""
    pattern = (_WORD, *_SPANS)[random.integers(1 + len(_SPANS))]
    (start, stop), (first, last) = _found(pattern, data, random), _found(pattern, data, random)
    return data[:start] + data[first:last] + data[stop:]


def _elements(data: bytes, random: np.random.Generator) -> bytes:
    """An element left out, or several times, or so often that a limit is passed."""
    start, stop = _found(_SPANS[random.integers(len(_SPANS))], data, random)
    count = 0 if random.integers(2) else _MANY[random.integers(len(_MANY))]
    return data[:start] + data[start:stop] * min(count, 3_000_000 // (stop - start + 1)) + data[stop:]


_FORMED = (
    *(_in_place(_NUMBER, _BOUNDS), _in_place(_NUMBER, _BOUNDS), _in_place(_TEXT, _TEXTS), _in_place(_WORD, _WORDS)),
    *(_exchange, _elements, _elements),
)
_MUTATIONS = (_flip, _set, _cut, _insert, _in_place(_NUMBER, _WORDS), *_FORMED, *_FORMED)


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
    floats, first = values.astype(float) if values.dtype.kind in "iuf" else b"x", values[:1] if values.ndim else values
    forms: tuple[Any, ...] = (floats, first, values.ravel(), 7, np.zeros((3,) * 5), np.array([b"x" * 500]), "x" * 3000)
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


_OBJECT_MUTATIONS = (_remove_object, _rename, _other_array, _value, _value, _attribute)
