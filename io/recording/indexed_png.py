"""PNG files as the numbers that they store, which OpenCV would turn into colours, stretch to 0..255, or not write.

An indexed PNG holds, for every pixel, a number below 2^bits and a palette of colours. OpenCV delivers the colours, and
stretches grey of less than 8 bits; Pillow delivers the numbers of palettes, and its stretching of grey is undone.
Source: PNG specification, third edition, W3C 2025, sections 5.3, 11.2.1 and 13.12.
"""

from __future__ import annotations

from io import BytesIO

import numpy as np
from PIL import Image

from stseg.arrays import AnyArray, Bytes

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _INDEXED = 0, 3


def stores_numbers(data: bytes) -> bool:
    """Whether the bytes are a PNG that OpenCV does not deliver as stored: indexed, or grey of less than 8 bits."""
    if data[:8] != _SIGNATURE or data[12:16] != b"IHDR" or len(data) < 29:
        return False
    bits, colour = data[24], data[25]
    return colour == _INDEXED or (colour == _GREY and bits < 8)


def declares_more(data: bytes) -> bool:
    """Whether the bytes are a PNG with a chunk that is longer than the file: OpenCV would make room for all of it."""
    at = len(_SIGNATURE)
    while data[:8] == _SIGNATURE and at + 8 <= len(data) and data[at + 4 : at + 8] != b"IEND":
        at += 12 + int.from_bytes(data[at : at + 4], "big")
    return at > len(data)


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
    try:
        with Image.open(BytesIO(data), formats=("PNG",)) as image:
            values = np.asarray(image, np.uint8)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):  # whatever Pillow makes of broken files
        return None
    if image.mode == "L":  # stretched from 0..2^bits - 1 to 0..255
        values = values // (255 // (2 ** data[24] - 1))
    return values if values.ndim == 2 else None


def encode_indexed(numbers: Bytes, palette: Bytes) -> bytes:
    """An indexed PNG of 8 bits.

    Parameters
    ----------
    numbers : uint8 (v, u)
    palette : uint8 (256, 3)
        Red, green, blue of each number.
    """
    image, file = Image.fromarray(numbers), BytesIO()
    image.putpalette(palette.tobytes())
    image.save(file, "PNG", bits=8)
    return file.getvalue()
