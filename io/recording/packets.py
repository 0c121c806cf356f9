"""The frames of a Motion JPEG video by its packets: each is a whole picture, so counting them decodes nothing."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Floats

_RAW = -1
"""OpenCV's word for packets as they are in the file."""
_START, _END = b"\xff\xd8", b"\xff\xd9"
_MARK, _DATA = 0xFF, 0xDA
"""What JPEG begins and ends a picture with, what it begins every part with, and the part that its data follow."""


def packet_times(path: Path) -> Floats | None:
    """The time that the file gives each frame, float64 (n,) milliseconds, as decoding the frames would find them.

    None where this cannot be told from packets: other codecs hold back and drop frames, and a packet that is no whole
    picture may give none.
    """
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    code = (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little")
    told = code.upper() == b"MJPG" and capture.set(cv2.CAP_PROP_FORMAT, _RAW)
    heads, times = set[bytes](), list[float]()
    while told and capture.grab():
        held, packet = capture.retrieve()
        head = _head(packet.tobytes()) if held else b""
        if head and head not in heads and cv2.imdecode(packet, cv2.IMREAD_GRAYSCALE) is not None:
            heads.add(head)
        told = head in heads
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    capture.release()
    return np.array(times, float) if told and times else None


def _head(packet: bytes) -> bytes:
    """What a JPEG picture says before its data: its size and tables, on which it hangs whether it decodes.

    Empty where the packet is no whole picture.
    """
    at, whole = len(_START), packet.startswith(_START) and packet.rstrip(b"\0").endswith(_END)
    while whole and at + 4 <= len(packet) and packet[at] == _MARK:
        end = at + 2 + int.from_bytes(packet[at + 2 : at + 4], "big")
        if packet[at + 1] == _DATA:
            return packet[:end]
        at = end
    return b""
