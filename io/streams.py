"""One camera's frames in order, whatever they are stored in."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from stseg.arrays import Boxes, Floats, Observation
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

    def times(self) -> Floats:
        """Pass over all that is left: the time that each frame states, milliseconds; nan where it states none."""

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

    def times(self) -> Floats:
        """Frames of a text file state no time."""
        return np.full(self.skip(self._table.frames), np.nan)

    def close(self) -> None:
        """Nothing is held open."""


def open_stream(source: Source, camera: Camera, times: Floats | None = None) -> Stream:
    """The stream of a source for a camera whose image size its frames must have.

    With the times of all its frames, as `Stream.times` gave them, a video need not be decoded up to a far frame.

    Raises
    ------
    SourceError, FormatError
        Where the source is missing, empty or not of its kind.
    """
    if source.kind == "boxes":
        return BoxStream(source)
    if source.kind == "video" or (source.kind == "masks" and not names_images(source.path)):
        return VideoStream(source, camera, times)
    return ImageStream(source, camera)
