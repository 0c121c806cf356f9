"""Mutations of a valid file: flipped, cut, doubled and replaced bytes, and values at which parsers break."""

from __future__ import annotations

import re

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
