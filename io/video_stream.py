"""A video file, frame after frame. Its length is what decodes: headers of real files lie."""

from __future__ import annotations

import os

# FFmpeg reads this at its first use; what goes wrong is said by a SourceError instead.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

from stseg.arrays import AnyArray
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.pictures import as_observation
from stseg.io.recording import Source

cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


class VideoStream:
    """Colour frames uint8 (v, u, 3) or, where the source's kind is masks, uint8 (v, u) of a video file.

    Raises
    ------
    SourceError
        Where the file is missing, no frame of it decodes, or its frames have not the camera's size.
    """

    def __init__(self, source: Source, camera: Camera) -> None:
        self._source, self._camera = source, camera
        if not source.path.is_file():
            raise self._error("no such file", "a video")
        # FFmpeg by name: the same decoder on every system, and seeking fallbacks of other backends stay out.
        self._capture = cv2.VideoCapture(str(source.path), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise self._error("a file that does not open as a video", "a video that FFmpeg decodes")
        self._frame = -1
        self._ended = False

    def skip(self, count: int) -> int:
        """Drop up to `count` frames by decoding them (seeking is not exact); how many there were."""
        skipped = 0
        while skipped < count and self._advance():
            skipped += 1
        return skipped

    def read(self) -> AnyArray | None:
        """The next frame; None after the last."""
        if not self._advance():
            return None
        decoded, picture = self._capture.retrieve()
        key = f"camera {self._camera.name}, frame {self._frame}"
        if not decoded:
            raise SourceError(self._source.path, key, "a broken frame", "one that decodes")
        return as_observation(picture, self._source.kind, self._camera.size, self._source.path, key)

    def close(self) -> None:
        """Let the file go."""
        self._capture.release()

    def _advance(self) -> bool:
        self._ended = self._ended or not self._capture.grab()
        if self._ended and self._frame < 0:
            raise self._error("no frame that decodes", "a video that FFmpeg decodes")
        self._frame += not self._ended
        return not self._ended

    def _error(self, found: str, expected: str) -> SourceError:
        return SourceError(self._source.path, f"camera {self._camera.name}", found, expected)
