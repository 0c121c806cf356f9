"""Volumes of frames as a run file packs them: each frame one chunk, shuffled by bytes and deflated.

They are packed here instead of by HDF5, which matches runs alone: a volume packs smaller and in half of the time.
Threads may pack frames side by side, and what is packed is copied from file to file. Most bytes of a significance are 0
in the whole frame (labels are small, log-odds are rounded); these are deflated once for all frames.
"""

import math
import zlib
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stseg.arrays import AnyArray, Ints, Labels

_LEVEL, _WINDOW, _MEMORY = 1, 15, 9
_HEADER, _END = b"\x78\x01", b"\x03\x00"
"""Bytes before and after the blocks of a stream (RFC 1950): a header for `_WINDOW`, and an empty last block."""


class PackedFrame(NamedTuple):
    """The log-odds or the labels of one frame, packed."""

    filters: int
    """HDF5's mask of the filters that were left out."""
    data: bytes
    """The bytes of the chunk."""


class PackedFrames(NamedTuple):
    """The log-odds or the labels of consecutive frames of a run file."""

    frames: Ints
    """int64 (time,): their numbers in the recording."""
    packed: list[PackedFrame]
    """One for each frame."""


def packed_frame(values: AnyArray) -> PackedFrame:
    """A frame (plane, y, x), of the type in the file, as HDF5's filters shuffle and deflate unpack it."""
    whole = np.ascontiguousarray(values).reshape(-1)
    used = np.bitwise_or.reduce(whole.view(f"u{whole.itemsize}"), keepdims=True).view(np.uint8) != 0
    blocks, checksum, number = [_HEADER], 1, len(whole)
    for significance, is_used in zip(whole.reshape(-1, 1).view(np.uint8).T, used.tolist(), strict=True):
        part = significance.tobytes() if is_used else b""
        blocks.append(_blocks(part) if is_used else _blocks_of_zeros(number))
        checksum = zlib.adler32(part, checksum) if is_used else _adler32_of_zeros(number, checksum)
    return PackedFrame(0, b"".join([*blocks, _END, checksum.to_bytes(4, "big")]))


def _adler32_of_zeros(number: int, checksum: int) -> int:
    """The checksum with so many zeros more (RFC 1950)."""
    low, high = checksum & 0xFFFF, checksum >> 16
    return (high + number * low) % 65521 << 16 | low


def _blocks(values: bytes) -> bytes:
    """Blocks of a deflated stream (RFC 1951) that depend on none before and are not the last."""
    deflate = zlib.compressobj(_LEVEL, zlib.DEFLATED, -_WINDOW, _MEMORY, zlib.Z_RLE)
    return deflate.compress(values) + deflate.flush(zlib.Z_FULL_FLUSH)


@lru_cache(maxsize=8)
def _blocks_of_zeros(number: int) -> bytes:
    return _blocks(bytes(number))


def unpacked_label(packed: PackedFrame, shape: tuple[int, ...]) -> Labels:
    """The labels that `packed_frame` packed, int32 (plane, y, x); ValueError where it did not, or not that many."""
    size = math.prod(shape) * 4
    inflate = zlib.decompressobj()
    try:
        values = inflate.decompress(packed.data, size + 1)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if packed.filters or len(values) != size or not inflate.eof:
        raise ValueError(f"labels of a frame packed otherwise than {size} bytes, shuffled and deflated")
    label = np.zeros(shape, np.int32)
    for k, part in enumerate(np.frombuffer(values, np.uint8).reshape(4, *shape)):
        if part.any():
            label |= part.astype(np.int32) << 8 * k
    return label
