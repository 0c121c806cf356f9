"""Synchronised frames of all cameras of a recording.

A recording's frames count from 0. A camera with offset o shows frame f of the recording in its own frame f - o, so a
positive offset is a camera that started late and a negative one a camera that started early. A camera whose
`on_missing` is "blind" sees nothing before its start and after its end; the others must be there from the first frame
that is asked for and must end together, and there the recording ends (where all may be blind, with the longest).
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from types import TracebackType

from stseg.arrays import Floats, Observation
from stseg.errors import ConfigError, SourceError
from stseg.geometry import Camera
from stseg.io.pictures import reduced_view
from stseg.io.recording import CameraSource, Recording
from stseg.io.streams import Stream, open_stream


@dataclass(frozen=True, slots=True)
class Moment:
    """What all cameras saw at one time.

    Attributes
    ----------
    frame
        The recording's frame.
    views
        One observation per camera in the rig's order, None where a camera is blind.
    """

    frame: int
    views: tuple[Observation, ...]


@dataclass(frozen=True)
class Streams:
    """What decoding a recording's streams to their ends tells.

    Attributes
    ----------
    length
        Frames of the recording.
    times : float64 (n,) each
        Of every frame of each file of each camera, milliseconds; nan where the source states none.
    """

    length: int
    times: tuple[tuple[Floats, ...], ...]


class _Feed:
    """A stream that is asked for frames of the recording rather than its own."""

    def __init__(self, camera: Camera, source: CameraSource, stream: Stream, factor: int) -> None:
        self.camera, self.source, self._stream, self._factor = camera, source, stream, factor
        self._next = 0
        self.end = math.inf
        """The recording's frame at which the stream ended; infinite while it goes on."""

    @property
    def required(self) -> bool:
        return self.source.on_missing == "error"

    def read(self, frame: int) -> Observation:
        """The view at a frame not before the last one asked for; None where the camera is blind."""
        own = frame - self.source.offset
        if own < 0 or self.end < math.inf:
            return None
        self._next += self._stream.skip(own - self._next)
        view = self._stream.read() if self._next == own else None
        if view is None:
            self.end = self._next + self.source.offset
        else:
            self._next += 1
        return reduced_view(view, self._factor)

    def run_out(self) -> tuple[Floats, ...]:
        """Pass over all frames, to learn where the stream ends; their times."""
        times = self._stream.times()
        self.end = sum(map(len, times)) + self.source.offset
        return tuple(times)

    def close(self) -> None:
        self._stream.close()


class FrameReader:
    """Moments of a recording in order; made by `open_frames`.

    One frame is decoded ahead, every camera in its own thread, while the caller works on the last one.

    Raises
    ------
    SourceError
        While iterating: where a stream ends before the others or the recording before the range, or a frame is broken
        or has not its camera's size.
    """

    def __init__(self, recording: Recording, first: int, stop: int | None, streams: Streams | None) -> None:
        self._recording, self._stop = recording, stop
        self._frame, self._least = first, first if stop is None else stop
        with ExitStack() as opened:
            self._feeds = _open_feeds(recording, opened, streams)
            _require_start(self._feeds, first)
            self._pool = opened.enter_context(ThreadPoolExecutor(_threads(recording)))
            self._opened = opened.pop_all()
        self._ahead = self._read_ahead()

    def __enter__(self) -> FrameReader:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[Moment]:
        return self

    def __next__(self) -> Moment:
        if self._frame == self._stop:
            raise StopIteration
        views = tuple(view.result() for view in self._ahead)
        length = _length(self._feeds)
        if length <= self._frame:
            if length < self._least:
                found = f"a recording of {length} frames"
                raise SourceError(self._recording.path, "frames", found, f"at least {self._least}")
            raise StopIteration
        moment = Moment(self._frame, views)
        self._frame += 1
        self._ahead = self._read_ahead()
        return moment

    def close(self) -> None:
        """Wait for the frame that is being decoded and let all streams go."""
        self._opened.close()

    def _read_ahead(self) -> list[Future[Observation]]:
        if self._frame == self._stop:
            return []
        return [self._pool.submit(feed.read, self._frame) for feed in self._feeds]


def open_frames(
    recording: Recording, first: int = 0, stop: int | None = None, streams: Streams | None = None
) -> FrameReader:
    """Read frames first..stop-1 of a recording, all cameras together.

    Parameters
    ----------
    recording
        The rig and its streams.
    first, stop
        The recording's frames to read, half open; they keep their numbers. None: to the end.
    streams
        What `count_streams` told: a far first frame is then sought.

    Returns
    -------
    FrameReader
        A context manager that yields one Moment per frame.

    Raises
    ------
    SourceError, FormatError
        Where a source is missing, empty or not of its kind, or a camera starts after the first frame.
    ConfigError
        Where the range is none.
    """
    if first < 0 or (stop is not None and stop < first):
        found = f"{first}:{'' if stop is None else stop}"
        raise ConfigError(recording.path, "frames", found, "first:stop, with 0 <= first <= stop")
    return FrameReader(recording, first, stop, streams)


def count_frames(recording: Recording) -> int:
    """How many frames a recording has; raises as `count_streams` does."""
    return count_streams(recording).length


def count_streams(recording: Recording) -> Streams:
    """How many frames a recording has, and when they were taken, found by decoding every stream to its end.

    Raises
    ------
    SourceError, FormatError
        Where a source is missing, empty or not of its kind, or the streams do not end together.
    """
    with ExitStack() as opened:
        feeds = _open_feeds(recording, opened)
        pool = opened.enter_context(ThreadPoolExecutor(_threads(recording)))
        times = [counted.result() for counted in [pool.submit(feed.run_out) for feed in feeds]]
        return Streams(int(_length(feeds)), tuple(times))


def read_camera(
    recording: Recording, camera_index: int, frames: Iterable[int], streams: Streams | None = None
) -> Iterator[Observation]:
    """What one camera shows in some frames of the recording, decoded as they are asked for; None where it is blind.

    Parameters
    ----------
    recording
        The rig and its streams.
    camera_index
        The camera, in the rig's order.
    frames
        Numbers of the recording's frames, rising.
    streams
        What `count_streams` told, for far frames.

    Raises
    ------
    SourceError, FormatError
        Where the source is missing, broken or not of the camera's size.
    """
    camera, source = recording.rig.cameras[camera_index], recording.sources[camera_index]
    times = None if streams is None else streams.times[camera_index]
    factor = recording.factors[camera_index]
    with closing(_Feed(camera, source, open_stream(source.source, camera, times), factor)) as feed:
        for frame in frames:
            yield feed.read(frame)


def read_background(recording: Recording, camera_index: int) -> Iterator[Observation]:
    """Frames of the empty scene as one camera shows it, decoded as they are asked for.

    Parameters
    ----------
    recording
        The rig and its streams.
    camera_index
        The camera, in the rig's order.

    Raises
    ------
    SourceError
        Where the camera has no background, or it is missing, broken or not of the camera's size.
    """
    camera, background = recording.rig.cameras[camera_index], recording.sources[camera_index].background
    if background is None:
        raise SourceError(recording.path, f"camera {camera.name}, background", "none", "a source of the empty scene")
    with closing(open_stream(background, camera)) as stream:
        while (view := stream.read()) is not None:
            yield reduced_view(view, recording.factors[camera_index])


def _open_feeds(recording: Recording, opened: ExitStack, streams: Streams | None = None) -> list[_Feed]:
    feeds: list[_Feed] = []
    times = [None] * len(recording.sources) if streams is None else streams.times
    cameras = zip(recording.rig.cameras, recording.sources, times, recording.factors, strict=True)
    for camera, source, own, factor in cameras:
        feeds.append(_Feed(camera, source, open_stream(source.source, camera, own), factor))
        opened.callback(feeds[-1].close)
    return feeds


def _threads(recording: Recording) -> int:
    return max(1, min(len(recording.sources), os.cpu_count() or 1))


def _require_start(feeds: list[_Feed], first: int) -> None:
    for feed in feeds:
        if feed.required and first < feed.source.offset:
            raise SourceError(
                feed.source.source.path,
                f"camera {feed.camera.name}, frame {first}",
                f"a stream that starts at frame {feed.source.offset}",
                'one that shows it, or on_missing = "blind"',
            )


def _length(feeds: list[_Feed]) -> float:
    """Where the recording ends; infinite while it goes on. SourceError where required streams do not end together."""
    required = [feed for feed in feeds if feed.required]
    if not required:
        return max(feed.end for feed in feeds)
    shortest, longest = min(required, key=_end), max(required, key=_end)
    if shortest.end < longest.end:
        raise SourceError(
            shortest.source.source.path,
            f"camera {shortest.camera.name}",
            f"its end at frame {shortest.end} while others go on",
            f'frames as long as camera {longest.camera.name}\'s, or on_missing = "blind"',
        )
    return shortest.end


def _end(feed: _Feed) -> float:
    return feed.end
