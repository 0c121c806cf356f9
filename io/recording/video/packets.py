"""Motion JPEG videos by their packets, each of which is a whole picture: time stamps without decoding, and pictures at
a half, a quarter or an eighth of their size, of which the decoder makes no more than is asked for."""

from pathlib import Path

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats
from stseg.io.recording.pictures import declared_size
from stseg.io.recording.video.ffmpeg import open_video
from stseg.io.untrusted import limits

_RAW = -1
"""Value of CAP_PROP_FORMAT at which OpenCV delivers undecoded packets."""
_START, _END = b"\xff\xd8", b"\xff\xd9"
_MARK, _DATA = 0xFF, 0xDA
"""Markers of JPEG: start and end of image; first byte of every marker; start of scan, which the data follow."""
_SCALED = {8: cv2.IMREAD_REDUCED_COLOR_8, 4: cv2.IMREAD_REDUCED_COLOR_4, 2: cv2.IMREAD_REDUCED_COLOR_2}
"""Reductions that the decoder can make, the greatest first."""


class PictureHeads:
    """Headers of JPEG pictures, their sizes and tables, that decode: what follows always makes some picture."""

    def __init__(self) -> None:
        self._known = set[bytes]()

    def fits(self, packet: Bytes) -> bool:
        """Whether a packet uint8 (byte,) is a complete picture, with a header that decodes."""
        head = _head(packet.tobytes())
        if head not in self._known and _is_bounded(head) and cv2.imdecode(packet, cv2.IMREAD_GRAYSCALE) is not None:
            self._known.add(head)
        return head in self._known


def packet_times(path: Path) -> Floats | None:
    """The time stamp of each frame, float64 (n,) milliseconds, equal to those found by decoding.

    None where packets do not determine them: other codecs reorder and drop frames, and an incomplete picture may not
    decode to a frame.
    """
    capture, heads, times = open_video(path, ""), PictureHeads(), list[float]()
    countable = deliver_packets(capture)
    while countable and capture.grab():
        is_valid, packet = capture.retrieve()
        countable = is_valid and heads.fits(np.asarray(packet, np.uint8).reshape(-1))
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    capture.release()
    return np.array(times, float) if countable and times else None


def deliver_packets(capture: cv2.VideoCapture) -> bool:
    """Make a capture deliver packets instead of pictures; False where it is no Motion JPEG, and for other reasons."""
    code = (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little")
    return bool(code.upper() == b"MJPG" and capture.set(cv2.CAP_PROP_FORMAT, _RAW))


def decoder_reduction(factor: int) -> int:
    """The greatest of the reductions 8, 4 and 2 by which `factor` is divisible; 1 for none."""
    return next((scale for scale in _SCALED if factor % scale == 0), 1)


def decode_reduced(packet: Bytes, size: tuple[int, int], scale: int) -> Bytes | None:
    """A JPEG packet uint8 (byte,) reduced by 2, 4 or 8 as it is decoded, uint8 (v, u, 3) BGR.

    Incomplete squares are left out. None where it does not decode, or has another size (width, height), pixels.
    """
    width, height = size
    picture = cv2.imdecode(packet, _SCALED[scale] | cv2.IMREAD_IGNORE_ORIENTATION)
    if picture is None or picture.shape != (-(-height // scale), -(-width // scale), 3):
        return None
    return np.asarray(picture[: height // scale, : width // scale], np.uint8)


def _is_bounded(head: bytes) -> bool:
    """Whether a header declares a picture, and none larger than are read."""
    size = declared_size(head) if head else None
    return size is not None and size[0] * size[1] <= limits.PIXELS and max(size) <= limits.SIDE


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
