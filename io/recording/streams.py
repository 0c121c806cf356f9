"""One camera's frames in order, behind one protocol for videos, images and boxes."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from stseg.arrays import Floats, Ints, Observation
from stseg.errors import InputError, SourceError
from stseg.geometry import Camera
from stseg.io.detections.source_detections import SourceDetections, instance_image, read_source
from stseg.io.recording.pictures import read_picture, reduced_view
from stseg.io.recording.recording import Source, mask_passwords
from stseg.io.recording.source_files import image_paths, is_detection_file, is_image_source, source_parts
from stseg.io.recording.video.time_stamps import no_stamps
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


class CountedStream:
    """Frames of known number that have no time stamps, each given by `read_frame`; nothing is held open."""

    def __init__(self, frames: int, read_frame: Callable[[int], Observation], filled: Ints | None = None) -> None:
        self._frames, self._read_frame, self._next = frames, read_frame, 0
        self.filled = filled
        """int64 (frame,), rising: the frames that hold a detection; None where that is not known."""

    def skip(self, count: int) -> int:
        """Skip up to `count` frames; return how many there were."""
        skipped = min(count, self._frames - self._next)
        self._next += skipped
        return skipped

    def read(self) -> Observation:
        """The next frame; None after the last."""
        return self._read_frame(self._next - 1) if self.skip(1) else None

    def times(self) -> list[Floats]:
        """Skip the rest: there are no time stamps."""
        return [no_stamps(self.skip(self._frames))]

    def close(self) -> None:
        """Nothing is held open."""


def open_boxes(source: Source, camera: Camera) -> CountedStream:
    """Boxes of a file or folder of detections, read whole at once; raises as `open_stream` does."""
    table = _detections(source, camera).table
    return CountedStream(table.frames or 0, table.at, np.unique(table.frame))


def open_masks(source: Source, camera: Camera) -> CountedStream:
    """Instance images drawn from the masks of a file or folder of detections; raises as `open_stream` does."""
    found = _detections(source, camera)

    def read_frame(number: int) -> Observation:
        return instance_image(found.kept, np.flatnonzero(found.kept.frame == number).tolist(), camera.size)

    return CountedStream(found.frames, read_frame, np.unique(found.kept.frame))


def _detections(source: Source, camera: Camera) -> SourceDetections:
    """The detections of a camera, which errors name."""
    try:
        return read_source(source, camera.size)
    except InputError as error:
        key = f"camera {camera.name}, {error.key}" if error.key else f"camera {camera.name}"
        raise type(error)(error.place, key, error.found, error.expected) from error


def open_images(source: Source, camera: Camera, factor: int) -> CountedStream:
    """Colour frames, masks or instance images from files (see `stseg.io.recording.pictures.read_picture`).

    SourceError where there is no file, the files do not number their frames without gaps, or, while reading, where one
    of them is broken or not of the camera's size.
    """
    key = f"camera {camera.name}"
    paths = image_paths(source.path, key)

    def read_frame(number: int) -> Observation:
        picture = read_picture(paths[number], source.kind, camera.size, f"{key}, frame {number}")
        return reduced_view(picture, factor)

    return CountedStream(len(paths), read_frame)


class JoinedStream:
    """Consecutive streams of one camera; one is open at a time.

    The parts are one source a file or folder, in chronological order, and `times` the stamps of their frames, where
    known.
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


def open_stream(source: Source, camera: Camera, times: Sequence[Floats] | None = None, factor: int = 1) -> Stream:
    """The stream of a source for a camera whose image size its frames must have.

    With the time stamps of all frames, from `Stream.times`, a video is not decoded up to a distant frame. Colour frames
    are reduced by a whole factor (`stseg.io.recording.pictures.reduced_view`).

    SourceError, FormatError where the source is missing, empty or not of its kind.
    """
    if source.address:
        place, expected = mask_passwords(source.address), "files; or stseg run --follow"
        raise SourceError(place, f"camera {camera.name}", "a live stream", expected)
    if source.detector is not None:
        expected = "boxes: stseg detect makes them, and a rig file with them; stseg run makes its own"
        raise SourceError(source.path, f"camera {camera.name}, detector", "a video without its boxes", expected)
    parts = source_parts(source, f"camera {camera.name}")
    if len(parts) > 1:
        return JoinedStream(parts, camera, times, factor)
    (source,) = parts
    if source.kind == "boxes":
        return open_boxes(source, camera)
    if source.kind == "instances" and is_detection_file(source.path):
        return open_masks(source, camera)
    if source.kind == "video" or (source.kind == "masks" and not is_image_source(source.path)):
        return VideoStream(source, camera, None if times is None else times[0], factor)
    return open_images(source, camera, factor)
