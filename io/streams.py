"""One camera's frames in order, whatever they are stored in."""

from __future__ import annotations

from typing import Protocol

from stseg.arrays import Boxes, Observation
from stseg.geometry import Camera
from stseg.io.box_files import read_boxes
from stseg.io.image_stream import ImageStream, names_images
from stseg.io.recording import Source
from stseg.io.video_stream import VideoStream


class Stream(Protocol):
    """Frames that are read once, from the first to the last."""

    def skip(self, count: int) -> int:
        """Pass over up to `count` frames; how many there were."""

    def read(self) -> Observation:
        """The next frame; None after the last."""

    def close(self) -> None:
        """Let go of what is open."""


class BoxStream:
    """Boxes of a text file, read whole at once."""

    def __init__(self, source: Source) -> None:
        self._table = read_boxes(source.path, source.first_frame, source.frames)
        self._next = 0

    def skip(self, count: int) -> int:
        """Pass over up to `count` frames; how many there were."""
        skipped = min(count, self._table.frames - self._next)
        self._next += skipped
        return skipped

    def read(self) -> Boxes | None:
        """The next frame's boxes, none where nothing was found; None after the last frame."""
        if self._next == self._table.frames:
            return None
        self._next += 1
        return self._table.at(self._next - 1)

    def close(self) -> None:
        """Nothing is held open."""


def open_stream(source: Source, camera: Camera) -> Stream:
    """The stream of a source for a camera whose image size its frames must have.

    Raises
    ------
    SourceError, FormatError
        Where the source is missing, empty or not of its kind.
    """
    if source.kind == "boxes":
        return BoxStream(source)
    if source.kind == "video" or (source.kind == "masks" and not names_images(source.path)):
        return VideoStream(source, camera)
    return ImageStream(source, camera)
