"""Frame size of a video, without a rig."""

from __future__ import annotations

from pathlib import Path

from stseg.errors import SourceError
from stseg.io.recording.video.ffmpeg import open_video


def read_video_size(path: Path) -> tuple[int, int]:
    """Width and height of a video's first frame, pixels.

    Raises
    ------
    SourceError
        Where the file is missing or nothing of it decodes.
    """
    capture = open_video(path, "")
    try:
        decoded, picture = capture.read()
    finally:
        capture.release()
    if not decoded:
        raise SourceError(path, "", "no frame that decodes", "a video that FFmpeg decodes")
    return int(picture.shape[1]), int(picture.shape[0])
