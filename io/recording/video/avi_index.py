"""Lost frames of damaged AVI files: what the index at the end lists, and is not where it says.

FFmpeg leaves out what it cannot read, and numbers what follows as if nothing had been there.
Source: Microsoft, AVI RIFF File Reference: AVIOLDINDEX.
"""

import os
import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stseg.arrays import Ints
from stseg.io.untrusted import limits

_ENTRY = np.dtype([("chunk", "S4"), ("flags", "<u4"), ("offset", "<u4"), ("size", "<u4")])
_VIDEO = (b"dc", b"db")
_HEAD = struct.Struct("<4sI")
_JPEG, _JPEG_END = b"\xff\xd8\xff", b"\xff\xd9"
_WHOLE, _CUT, _LOST = range(3)


def lost_frames(path: Path, decoded: int) -> Ints | None:
    """Numbers of the frames that a video lost to damage, int64 (n,), rising, by the number of those that were decoded.

    Empty where nothing is lost, or the file is no AVI with an index. None where frames are lost that the index does not
    place.
    """
    try:
        with path.open("rb") as file:
            entries, base = _index(file)
            if len(entries) <= decoded:
                return np.zeros(0, np.int64)
            states = np.array([_state(file, base + int(entry["offset"]), entry) for entry in entries])
    except (OSError, ValueError, struct.error):
        return np.zeros(0, np.int64)
    # A picture that is cut decodes, or does not.
    for lost in (states == _LOST, states != _WHOLE):
        if len(entries) - lost.sum() == decoded:
            return np.flatnonzero(lost)
    return None


def _state(file: BinaryIO, place: int, entry: np.void) -> int:
    """Whether the chunk of an entry is whole, cut (Motion JPEG without its end) or lost."""
    if _head_at(file, place) != (entry["chunk"], entry["size"]):
        return _LOST
    packet = file.read(min(int(entry["size"]), limits.TEXT_FILE))
    is_whole = not packet.startswith(_JPEG) or packet.rstrip(b"\0").endswith(_JPEG_END)
    return _WHOLE if is_whole else _CUT


def _index(file: BinaryIO) -> tuple[np.ndarray, int]:
    """Entries of the index of the first video stream, and the place from which their offsets count.

    ValueError where there is none, or it is not of the whole file.
    """
    name, size = _HEAD.unpack(file.read(_HEAD.size))
    if name != b"RIFF" or file.read(4) != b"AVI ":
        raise ValueError("no AVI")
    end, movie = _HEAD.size + size, -1
    if end < os.fstat(file.fileno()).st_size - 1:
        raise ValueError("more than one RIFF, whose indexes are others")
    while file.tell() + _HEAD.size <= end:
        name, size = _HEAD.unpack(file.read(_HEAD.size))
        begin = file.tell()
        if name == b"LIST" and file.read(4) == b"movi":
            movie = begin
        if name == b"idx1" and movie >= 0 and size <= limits.DETECTIONS_FILE:
            return _of_video(file, np.frombuffer(file.read(size // _ENTRY.itemsize * _ENTRY.itemsize), _ENTRY), movie)
        file.seek(begin + size + size % 2)
    raise ValueError("no index")


def _of_video(file: BinaryIO, entries: np.ndarray, movie: int) -> tuple[np.ndarray, int]:
    """The entries of the first video stream, all of which are frames; offsets count from the list or from the file."""
    videos = sorted({chunk for chunk in entries["chunk"].tolist() if chunk[2:] in _VIDEO})
    frames = entries[np.isin(entries["chunk"], [one for one in videos if one[:2] == videos[0][:2]])]
    if not len(frames) or (frames["size"] == 0).any():
        raise ValueError("no frames, or some that repeat the one before")
    first = frames[0]
    for base in (movie, 0):
        if _head_at(file, base + int(first["offset"])) == (first["chunk"], first["size"]):
            return frames, base
    raise ValueError("an index of another file")


def _head_at(file: BinaryIO, place: int) -> tuple[bytes, int]:
    """Name and size of the chunk at a place."""
    file.seek(place)
    head = file.read(_HEAD.size)
    return _HEAD.unpack(head) if len(head) == _HEAD.size else (b"", 0)
