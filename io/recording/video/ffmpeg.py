"""Local video files for FFmpeg, as files and nothing else.

FFmpeg takes a path for an address: what stands before a colon is a protocol, and playlists name other files and hosts.
So a path is given as `file:PATH`, the protocol of files is the only one allowed, and what is text, as all playlists and
session descriptions are, is refused: no container of video is text.
"""

import math
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Condition

from stseg.errors import SourceError

# Silences FFmpeg, which reads this at its first use; failures raise SourceError instead.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

from stseg.io.untrusted import limits

cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

_OPTIONS, _FILES_ONLY = "OPENCV_FFMPEG_CAPTURE_OPTIONS", "protocol_whitelist;file"
_turn, _openings = Condition(), list[tuple[str, str | None]]()
"""Captures that are being opened: their options, which OpenCV takes from the environment alone, and those before."""

_HEAD = 512
_TEXT_VIDEO = b"YUV4MPEG2"
"""The one video format whose header is text."""


def open_video(path: Path, key: str) -> cv2.VideoCapture:
    """A local video file, open.

    SourceError where it is no regular file, text, nothing that FFmpeg opens, or of larger frames than are read.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except (OSError, ValueError) as error:
        found = "no such file" if isinstance(error, FileNotFoundError) else getattr(error, "strerror", None) or error
        raise SourceError(path, key, found, "a video") from error
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise SourceError(path, key, "no regular file", "a video")
        head = os.pread(descriptor, _HEAD, 0)
        if _is_text(head):
            raise SourceError(path, key, "a text, such as a playlist", "a video that FFmpeg decodes")
        with ffmpeg_options(_FILES_ONLY):
            capture = cv2.VideoCapture(_address(path, descriptor), cv2.CAP_FFMPEG)
    finally:
        os.close(descriptor)
    size = tuple(capture.get(side) for side in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if size[0] * size[1] > limits.PIXELS or max(size) > limits.SIDE:
        capture.release()
        raise SourceError(path, key, f"frames of {size[0]:g}x{size[1]:g}", f"at most {limits.PIXELS} pixels")
    return capture


@contextmanager
def ffmpeg_options(options: str, is_default: bool = False) -> Iterator[None]:
    """FFmpeg has these options within the body, or those of the environment where these are but the default.

    The environment is as before afterwards. Bodies with the same options run at the same time, others one by one.
    """
    with _turn:
        _turn.wait_for(lambda: all(others == options for others, _ in _openings))
        given = _openings[0][1] if _openings else os.environ.get(_OPTIONS)
        _openings.append((options, given))
        os.environ[_OPTIONS] = given if is_default and given is not None else options
    try:
        yield
    finally:
        with _turn:
            _openings.pop()
            if not _openings:
                os.environ.pop(_OPTIONS)
                os.environ.update({} if given is None else {_OPTIONS: given})
                _turn.notify_all()


def _address(path: Path, descriptor: int) -> str:
    """The path as FFmpeg opens it; one that is no UTF-8 by its descriptor, which stays open meanwhile."""
    text = str(path.absolute())
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return f"file:/proc/self/fd/{descriptor}"
    return f"file:{text}"


def _is_text(head: bytes) -> bool:
    printable = set(range(0x20, 0x7F)) | {0x09, 0x0A, 0x0D}
    head = head.removeprefix(b"\xef\xbb\xbf")
    return bool(head) and not head.startswith(_TEXT_VIDEO) and set(head) <= printable


def read_video_size(path: Path) -> tuple[int, int]:
    """Width and height of a video's first frame, pixels.

    SourceError where the file is missing or nothing of it decodes.
    """
    capture = open_video(path, "")
    try:
        decoded, picture = capture.read()
    finally:
        capture.release()
    if not decoded:
        raise SourceError(path, "", "no frame that decodes", "a video that FFmpeg decodes")
    return int(picture.shape[1]), int(picture.shape[0])


def read_frame_rate(path: Path) -> float | None:
    """Frames per second by a video's head; None where it gives none."""
    capture = open_video(path, "")
    rate = capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    return float(rate) if math.isfinite(rate) and rate > 0 else None
