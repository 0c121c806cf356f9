"""PNG files as the numbers that they store, which OpenCV would turn into colours, stretch to 0..255, or not write.

An indexed PNG holds, for every pixel, a number below 2^bits and a palette of colours; OpenCV delivers the colours. The
scan lines, filters and interlacing of an indexed PNG are exactly those of a grey one of the same depth, so the file is
renamed: its header says grey, the palette goes, and OpenCV decodes the numbers. Grey of less than 8 bits is stretched
by OpenCV (a 4-bit 3 becomes 3 * 17), and that is undone.
Source: PNG specification, third edition, W3C 2025, sections 5.3, 11.2.1 and 13.12.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _INDEXED = 0, 3
_HEADER = struct.Struct(">IIBBBBB")
_KEPT = (b"IHDR", b"IDAT", b"IEND")


def stores_numbers(data: bytes) -> bool:
    """Whether the bytes are a PNG that OpenCV does not deliver as stored: indexed, or grey of less than 8 bits."""
    if data[:8] != _SIGNATURE or data[12:16] != b"IHDR" or len(data) < 29:
        return False
    bits, colour = data[24], data[25]
    return colour == _INDEXED or (colour == _GREY and bits < 8)


def decode_indexed(data: bytes) -> AnyArray | None:
    """The numbers of a PNG for which `stores_numbers` holds.

    Parameters
    ----------
    data
        The file.

    Returns
    -------
    uint8 (v, u)
        0..2^bits - 1, or None where the file is broken.
    """
    bits = data[24]
    if bits not in (1, 2, 4, 8):
        return None
    grey = _SIGNATURE + b"".join(_chunk(name, body) for name, body in _chunks(data) if name in _KEPT)
    stretched = cv2.imdecode(np.frombuffer(grey, np.uint8), cv2.IMREAD_UNCHANGED)
    return None if stretched is None else np.asarray(stretched // (255 // (2**bits - 1)), np.uint8)


def encode_indexed(numbers: Bytes, palette: Bytes) -> bytes:
    """An indexed PNG of 8 bits.

    Parameters
    ----------
    numbers : uint8 (v, u)
    palette : uint8 (256, 3)
        Red, green, blue of each number.
    """
    height, width = numbers.shape
    lines = np.zeros((height, width + 1), np.uint8)  # each line begins with its filter, none
    lines[:, 1:] = numbers
    header = _HEADER.pack(width, height, 8, _INDEXED, 0, 0, 0)
    bodies = (header, palette.tobytes(), zlib.compress(lines.tobytes()), b"")
    names = (b"IHDR", b"PLTE", b"IDAT", b"IEND")
    return _SIGNATURE + b"".join(_chunk(name, body) for name, body in zip(names, bodies, strict=True))


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and bodies of the chunks, the header saying grey; a chunk whose checksum is wrong ends them."""
    start = len(_SIGNATURE)
    while start + 12 <= len(data):
        length = int.from_bytes(data[start : start + 4], "big")
        name, body = data[start + 4 : start + 8], data[start + 8 : start + 8 + length]
        if data[start + 8 + length : start + 12 + length] != _sum(name, body):
            return
        yield name, _as_grey(body) if name == b"IHDR" else body
        start += 12 + length


def _as_grey(header: bytes) -> bytes:
    width, height, bits, _, *methods = _HEADER.unpack(header)
    return _HEADER.pack(width, height, bits, _GREY, *methods)


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + _sum(name, body)


def _sum(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", zlib.crc32(name + body))
