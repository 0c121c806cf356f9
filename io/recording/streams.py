"""One camera's frames in order, behind one protocol for videos, images and boxes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from stseg.arrays import Boxes, Floats, Observation
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.detections.source_detections import instance_image, read_source
from stseg.io.recording.image_stream import ImageStream, is_detection_file, is_image_source
from stseg.io.recording.recording import Source, mask_passwords
from stseg.io.recording.source_files import source_parts
from stseg.io.recording.video.video_stream import VideoStream


class Stream(Protocol):
    """Frames read once, from the first to the last."""

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were."""

    def read(self) -> Observation:
        """The next frame; None after the last."""

    def times(self) -> list[Floats]:
        """Skip the rest and return the time stamps, milliseconds, nan where there is none.

        One array a file; each file's stamps start again.
        """

    def close(self) -> None:
        """Close what is open."""


class BoxStream:
    """Boxes of a file or folder of detections, read whole at once."""

    def __init__(self, source: Source, camera: Camera) -> None:
        self._table = read_source(source, camera.size).table
        self._next = 0

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were."""
        skipped = min(count, self._table.frames - self._next)
        self._next += skipped
        return skipped

    def read(self) -> Boxes | None:
        """The next frame's boxes, none where nothing was found; None after the last frame."""
        if self._next == self._table.frames:
            return None
        self._next += 1
        return self._table.at(self._next - 1)

    def times(self) -> list[Floats]:
        """Frames of a text file have no time stamps."""
        return [np.full(self.skip(self._table.frames), np.nan)]

    def close(self) -> None:
        """Nothing is held open."""


class MaskStream:
    """Instance images drawn from the masks of a file or folder of detections."""

    def __init__(self, source: Source, camera: Camera) -> None:
        self._found, self._size = read_source(source, camera.size), camera.size
        self._next = 0

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were."""
        skipped = min(count, self._found.frames - self._next)
        self._next += skipped
        return skipped

    def read(self) -> Observation:
        """The next frame's instance image; None after the last frame."""
        if not self.skip(1):
            return None
        rows = np.flatnonzero(self._found.kept.frame == self._next - 1)
        return instance_image(self._found.kept, rows.tolist(), self._size)

    def times(self) -> list[Floats]:
        """Detections have no time stamps."""
        return [np.full(self.skip(self._found.frames), np.nan)]

    def close(self) -> None:
        """Nothing is held open."""


class JoinedStream:
    """Consecutive streams of one camera; one is open at a time.

    Parameters
    ----------
    parts, camera
        One source a file or folder, in chronological order.
    times
        Time stamps of the frames of each part, where known.
    factor
        Reduction of colour frames.
    """

    def __init__(self, parts: Sequence[Source], camera: Camera, times: Sequence[Floats] | None, factor: int) -> None:
        self._parts, self._camera, self._times, self._factor = parts, camera, times, factor
        self._at = 0
        self._stream = self._open()

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were. Parts of known length are skipped unopened."""
        skipped = self._skip_here(count)
        while skipped < count and self._next():
            skipped += self._skip_here(count - skipped)
        return skipped

    def read(self) -> Observation:
        """The next frame; None after the last."""
        view = self._stream.read()
        while view is None and self._next():
            view = self._stream.read()
        return view

    def times(self) -> list[Floats]:
        """Skip the rest and return the time stamps, one array a part."""
        found = self._stream.times()
        while self._next():
            found += self._stream.times()
        return found

    def close(self) -> None:
        """Close what is open."""
        self._stream.close()

    def _skip_here(self, count: int) -> int:
        """Skip in this part, and in following whole parts of known length."""
        skipped = self._stream.skip(count)
        while skipped < count and self._times is not None and self._at + 1 < len(self._parts) - 1:
            length = len(self._times[self._at + 1])
            if length > count - skipped:
                break
            self._at += 1
            skipped += length
        return skipped

    def _next(self) -> bool:
        if self._at + 1 == len(self._parts):
            return False
        self._stream.close()
        self._at += 1
        self._stream = self._open()
        return True

    def _open(self) -> Stream:
        stamps = None if self._times is None else [self._times[self._at]]
        return open_stream(self._parts[self._at], self._camera, stamps, self._factor)


def open_stream(
    source: Source, camera: Camera, times: Sequence[Floats] | None = None, factor: int = 1
) -> Stream:  # fmt: skip
    """The stream of a source for a camera whose image size its frames must have.

    With the time stamps of all frames, from `Stream.times`, a video is not decoded up to a distant frame. Colour frames
    are reduced by a whole factor (`stseg.io.recording.pictures.reduced_view`).

    Raises
    ------
    SourceError, FormatError
        Where the source is missing, empty or not of its kind.
    """
    if source.address:
        raise SourceError(
            mask_passwords(source.address), f"camera {camera.name}", "a live stream", "files; or stseg run --follow"
        )
    parts = source_parts(source, f"camera {camera.name}")
    if len(parts) > 1:
        return JoinedStream(parts, camera, times, factor)
    (source,) = parts
    if source.kind == "boxes":
        return BoxStream(source, camera)
    if source.kind == "instances" and is_detection_file(source.path):
        return MaskStream(source, camera)
    if source.kind == "video" or (source.kind == "masks" and not is_image_source(source.path)):
        return VideoStream(source, camera, None if times is None else times[0], factor)
    return ImageStream(source, camera, factor)
