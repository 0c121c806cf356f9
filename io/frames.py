"""Synchronised frames of all cameras of a recording.

A recording's frames count from 0. A camera with offset o shows frame f of the recording in its own frame f - o, so a
positive offset is a camera that started late and a negative one a camera that started early. A camera whose
`on_missing` is "blind" sees nothing before its start and after its end; the others must be there from the first frame
that is asked for and must end together, and there the recording ends (where all may be blind, with the longest).

That is so where a camera's frames are counted. Where their times are known, and are not those of their numbers, the
camera shows a frame of the recording in the own frame that was taken nearest to then, and is blind where there is none
(`stseg.io.clock`).
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Observation
from stseg.errors import ConfigError, SourceError
from stseg.geometry import Camera
from stseg.io.clock import clock_of, placed, seen
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
    shown : int64 (tick,) or None each
        `CameraSource.shown` of each camera.
    notes
        What a user should be told of it, one line each.
    """

    length: int
    times: tuple[tuple[Floats, ...], ...]
    shown: tuple[Ints | None, ...] = ()
    notes: tuple[str, ...] = ()

    def seen(self, recording: Recording) -> Flags:
        """Which frames of the recording that was counted each camera shows, bool (camera, length)."""
        counts = [sum(map(len, own)) for own in self.times]
        return seen(placed(recording, self.shown), counts, self.length)

    def shared(self, recording: Recording) -> tuple[int, int]:
        """The part of it that two cameras show, where none must be there all the time; else all of it.

        Two views tell where somebody is; of what one alone shows, at the beginning and the end, little can be told.
        """
        if any(source.on_missing == "error" for source in recording.sources):
            return 0, self.length
        told = np.flatnonzero(self.seen(recording).sum(axis=0) >= min(2, len(recording.sources)))
        return (int(told[0]), int(told[-1]) + 1) if len(told) else (0, self.length)


class _Feed:
    """A stream that is asked for frames of the recording rather than its own."""

    def __init__(self, camera: Camera, source: CameraSource, stream: Stream, factor: int) -> None:
        self.camera, self.source, self._stream, self._factor = camera, source, stream, factor
        self._next = 0
        self._last: Observation = None
        self.end = math.inf
        """The recording's frame at which the stream ended; infinite while it goes on."""

    @property
    def required(self) -> bool:
        return self.source.on_missing == "error"

    def read(self, frame: int) -> Observation:
        """The view at a frame not before the last one asked for; None where the camera is blind."""
        tick, shown = frame - self.source.offset, self.source.shown
        if tick < 0 or self.end < math.inf:
            return None
        if shown is None:
            return self._own(tick)
        if tick >= len(shown):
            self.end = len(shown) + self.source.offset
            return None
        own = int(shown[tick])
        if own >= self._next:
            self._last = self._own(own)
        return None if own < 0 else self._last

    def _own(self, number: int) -> Observation:
        """One of the stream's own frames, not before the last that was read."""
        self._next += self._stream.skip(number - self._next)
        view = self._stream.read() if self._next == number else None
        if view is None:
            self.end = self._next + self.source.offset
        else:
            self._next += 1
        return reduced_view(view, self._factor)

    def run_out(self) -> tuple[Floats, ...]:
        """Pass over all frames; their times."""
        return tuple(self._stream.times())

    def place(self, source: CameraSource, frames: int) -> None:
        """Learn which of the stream's frames shows when, and so where it ends."""
        self.source = source
        self.end = source.offset + (frames if source.shown is None else len(source.shown))

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
        What `count_streams` told: frames are then placed in time, and a far first one is sought.

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
    return FrameReader(placed(recording, streams.shown) if streams else recording, first, stop, streams)


def count_frames(recording: Recording) -> int:
    """How many frames a recording has; raises as `count_streams` does."""
    return count_streams(recording).length


def count_streams(recording: Recording) -> Streams:
    """How many frames a recording has, and which frames of the cameras show them, by decoding all to their ends.

    Raises
    ------
    SourceError, FormatError
        Where a source is missing, empty or not of its kind, or the streams do not end together.
    """
    with ExitStack() as opened:
        feeds = _open_feeds(recording, opened)
        pool = opened.enter_context(ThreadPoolExecutor(_threads(recording)))
        times = tuple(counted.result() for counted in [pool.submit(feed.run_out) for feed in feeds])
    clock = clock_of(recording, times)
    for feed, source, own in zip(feeds, placed(recording, clock.shown).sources, times, strict=True):
        feed.place(source, sum(map(len, own)))
    return Streams(int(_length(feeds)), times, clock.shown, clock.notes)


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
        What `count_streams` told, for frames placed in time and far ones.

    Raises
    ------
    SourceError, FormatError
        Where the source is missing, broken or not of the camera's size.
    """
    sources = placed(recording, streams.shown).sources if streams else recording.sources
    camera, source = recording.rig.cameras[camera_index], sources[camera_index]
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
        by_time = any(feed.source.shown is not None for feed in (shortest, longest))
        raise SourceError(
            shortest.source.source.path,
            f"camera {shortest.camera.name}",
            f"its end at frame {shortest.end} while others go on",
            f'frames as long as camera {longest.camera.name}\'s, or on_missing = "blind"'
            + (', or clock = "count" where it went by time stamps' if by_time else ""),
        )
    return shortest.end


def _end(feed: _Feed) -> float:
    return feed.end
