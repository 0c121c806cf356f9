"""Image files and decoded pictures as observations: colour frames, masks and instance images.

An indexed PNG holds, for every pixel, a number below 2^bits and a palette of colours. OpenCV delivers the colours, and
stretches grey of less than 8 bits; Pillow delivers the numbers of palettes, and its stretching of grey is undone.
Source: PNG specification, third edition, W3C 2025, sections 5.3, 11.2.1 and 13.12.
"""

from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from stseg.arrays import AnyArray, Bytes, Observation
from stseg.errors import SourceError
from stseg.io.recording.recording import SourceKind
from stseg.io.untrusted.bounded_files import read_bytes, reading

# Video codecs leave a trace of colour on grey; real colour pictures have far more.
_GREY_SPREAD = 32
_FORMATS = ("BMP", "JPEG", "PNG", "PPM", "TIFF", "WEBP")
_MOST_BYTES = 1 << 29
"""Bytes of an image file."""
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _INDEXED = 0, 3


def read_picture(path: Path, kind: SourceKind, size: tuple[int, int] | None, key: str) -> AnyArray:
    """One image file as an observation of a kind.

    video or images: uint8 (v, u, 3) BGR; masks: uint8 (v, u); instances: uint16 (v, u). `size` is the width and
    height that it must have, pixels, None for any, `key` the camera and frame, for errors. SourceError where the file
    cannot be read or decoded, or is not of that kind or size.
    """
    with reading(path, "an image", SourceError, key):
        data = read_bytes(path, _MOST_BYTES)
    declared = declared_size(data)
    size = size or declared or (0, 0)
    if declared is not None and sorted(declared) != sorted(size):  # Exif may turn it
        found, expected = f"an image of {declared[0]}x{declared[1]}", f"{size[0]}x{size[1]}, the size of the camera"
        raise SourceError(path, key, found, expected)
    picture = _decode(data, kind) if declared is not None else None
    if picture is None:
        raise SourceError(path, key, "a broken file", "an image that decodes")
    return picture_observation(picture, kind, size, path, key)


def declared_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in the header of an image file, before anything is decoded; None where it is no image."""
    Image.init()
    for name in _FORMATS:
        read, accepts = Image.OPEN[name]
        try:
            if accepts is None or accepts(data[:16]) is True:
                return read(BytesIO(data), "").size
        except Exception:  # whatever Pillow makes of broken headers
            continue
    return None


def read_colour(path: Path) -> Bytes:
    """One image file in colour, uint8 (v, u, 3); raises as `read_picture` does."""
    return np.asarray(read_picture(path, "images", None, ""), np.uint8)


def reduced_view(view: Observation, factor: int) -> Observation:
    """A colour frame reduced by a whole factor, each pixel the mean of a square; other observations unchanged."""
    if factor == 1 or not isinstance(view, np.ndarray) or view.ndim != 3:
        return view
    return np.asarray(reduced_picture(view, factor), np.uint8)


def reduced_picture(picture: AnyArray, factor: int) -> AnyArray:
    """A picture (v, u) or (v, u, 3) reduced by a whole factor; incomplete squares at its edges are dropped."""
    if factor == 1:
        return picture
    height, width = picture.shape[0] // factor, picture.shape[1] // factor
    whole = picture[: height * factor, : width * factor]
    return cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)


def _decode(data: bytes, kind: SourceKind) -> AnyArray | None:
    """The picture in a file's bytes, None where it is broken."""
    if not data or declares_more(data):
        return None
    flags = cv2.IMREAD_COLOR if kind in ("video", "images") else cv2.IMREAD_UNCHANGED
    try:
        if kind == "instances" and stores_numbers(data):
            return decode_indexed(data)
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None


def picture_observation(picture: AnyArray, kind: SourceKind, size: tuple[int, int], place: Path, key: str) -> AnyArray:
    """A decoded picture as an array of its kind, see `read_picture`; SourceError where it is of another."""
    height, width = picture.shape[:2]
    if (width, height) != size:
        raise SourceError(place, key, f"an image of {width}x{height}", f"{size[0]}x{size[1]}, the size of the camera")
    if kind == "instances":
        return _instances(picture, place, key)
    if picture.dtype != np.uint8:
        raise SourceError(place, key, f"values of type {picture.dtype}", "8 bits a channel")
    return _mask(picture, place, key) if kind == "masks" else _colour(picture)


def _colour(picture: AnyArray) -> AnyArray:
    if picture.ndim == 2:
        return cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    return picture if picture.shape[2] == 3 else cv2.cvtColor(picture, cv2.COLOR_BGRA2BGR)


def _mask(picture: AnyArray, place: Path, key: str) -> AnyArray:
    if picture.ndim == 2:
        return picture
    colour = _colour(picture)
    blue, green, red = np.moveaxis(colour[::4, ::4], 2, 0)
    spread = np.maximum(np.maximum(blue, green), red) - np.minimum(np.minimum(blue, green), red)
    if spread.max() > _GREY_SPREAD:
        raise SourceError(place, key, "a picture in colours", 'a grey mask, 0..255 (kind = "masks")')
    return cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)


def _instances(picture: AnyArray, place: Path, key: str) -> AnyArray:
    if picture.ndim != 2 or picture.dtype not in (np.uint8, np.uint16):
        found = "a picture in colours" if picture.ndim != 2 else f"values of type {picture.dtype}"
        raise SourceError(place, key, found, "one channel of 8 or 16 bits, one value an instance, or an indexed PNG")
    return picture.astype(np.uint16)


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
    """The numbers of a PNG for which `stores_numbers` holds, uint8 (v, u), 0..2^bits - 1; None for a broken file."""
    try:
        with Image.open(BytesIO(data), formats=("PNG",)) as image:
            values = np.asarray(image, np.uint8)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):  # whatever Pillow makes of broken files
        return None
    if image.mode == "L":  # stretched from 0..2^bits - 1 to 0..255
        values = values // (255 // (2 ** data[24] - 1))
    return values if values.ndim == 2 else None


def encode_indexed(numbers: Bytes, palette: Bytes) -> bytes:
    """An indexed PNG of 8 bits: numbers uint8 (v, u), palette uint8 (256, 3) with red, green, blue of each number."""
    image, file = Image.fromarray(numbers), BytesIO()
    image.putpalette(palette.tobytes())
    image.save(file, "PNG", bits=8)
    return file.getvalue()
