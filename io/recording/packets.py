"""Time stamps of a Motion JPEG video from its packets, without decoding: each packet is a whole picture."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Floats
from stseg.io.recording.ffmpeg import open_video

_RAW = -1
"""Value of CAP_PROP_FORMAT at which OpenCV delivers undecoded packets."""
_START, _END = b"\xff\xd8", b"\xff\xd9"
_MARK, _DATA = 0xFF, 0xDA
"""Markers of JPEG: start and end of image; first byte of every marker; start of scan, which the data follow."""


def packet_times(path: Path) -> Floats | None:
    """The time stamp of each frame, float64 (n,) milliseconds, equal to those found by decoding.

    None where packets do not determine them: other codecs reorder and drop frames, and an incomplete picture may not
    decode to a frame.
    """
    capture = open_video(path, "")
    code = (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little")
    countable = code.upper() == b"MJPG" and capture.set(cv2.CAP_PROP_FORMAT, _RAW)
    heads, times = set[bytes](), list[float]()
    while countable and capture.grab():
        held, packet = capture.retrieve()
        head = _head(packet.tobytes()) if held else b""
        if head and head not in heads and cv2.imdecode(packet, cv2.IMREAD_GRAYSCALE) is not None:
            heads.add(head)
        countable = head in heads
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    capture.release()
    return np.array(times, float) if countable and times else None


def _head(packet: bytes) -> bytes:
    """The header of a JPEG picture: its size and tables, which decide whether it decodes.

    Empty where the packet is no complete picture.
    """
    at, whole = len(_START), packet.startswith(_START) and packet.rstrip(b"\0").endswith(_END)
    while whole and at + 4 <= len(packet) and packet[at] == _MARK:
        end = at + 2 + int.from_bytes(packet[at + 2 : at + 4], "big")
        if packet[at + 1] == _DATA:
            return packet[:end]
        at = end
    return b""
