"""Frame size of a video, without a rig."""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

from stseg.errors import SourceError


def read_video_size(path: Path) -> tuple[int, int]:
    """Width and height of a video's first frame, pixels.

    Raises
    ------
    SourceError
        Where the file is missing or nothing of it decodes.
    """
    if not path.is_file():
        raise SourceError(path, "", "no such file", "a video")
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        decoded, picture = capture.read()
    finally:
        capture.release()
    if not decoded:
        raise SourceError(path, "", "no frame that decodes", "a video that FFmpeg decodes")
    return int(picture.shape[1]), int(picture.shape[0])
