"""Synchronised frames of all cameras of a recording.

A recording's frames count from 0. A camera with offset o shows frame f of the recording in its own frame f - o, so a
positive offset is a camera that started late and a negative one a camera that started early. A camera whose
`on_missing` is "blind" sees nothing before its start and after its end; the others must be there from the first frame
that is asked for and must end together, and there the recording ends (where all may be blind, with the longest).

That is so where a camera's frames are counted. Where their times are known, and are not those of their numbers, the
camera shows a frame of the recording in the own frame that was taken nearest to then, and is blind where there is none
(`stseg.io.recording.time_alignment`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from types import TracebackType

from stseg.arrays import Observation
from stseg.errors import ConfigError, SourceError
from stseg.io.recording.aligned_stream import (
    AlignedStream,
    decoder_threads,
    open_aligned_stream,
    open_aligned_streams,
    recording_length,
)
from stseg.io.recording.pictures import reduced_view
from stseg.io.recording.recording import Recording
from stseg.io.recording.stream_index import StreamIndex
from stseg.io.recording.streams import open_stream
from stseg.io.recording.time_alignment import with_alignment


@dataclass(frozen=True, slots=True)
class FrameSet:
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


class FrameReader:
    """Moments of a recording in order; made by `open_frames`.

    One frame is decoded ahead, every camera in its own thread, while the caller works on the last one.

    Raises
    ------
    SourceError
        While iterating: where a stream ends before the others or the recording before the range, or a frame is broken
        or has not its camera's size.
    """

    def __init__(self, recording: Recording, first: int, stop: int | None, streams: StreamIndex | None) -> None:
        self._recording, self._stop = recording, stop
        self._frame, self._least = first, first if stop is None else stop
        with ExitStack() as opened:
            self._feeds = open_aligned_streams(recording, opened, streams.times if streams else ())
            _require_start(self._feeds, first)
            self._pool = opened.enter_context(ThreadPoolExecutor(decoder_threads(recording)))
            self._opened = opened.pop_all()
        self._ahead = self._read_ahead()

    def __enter__(self) -> FrameReader:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[FrameSet]:
        return self

    def __next__(self) -> FrameSet:
        if self._frame == self._stop:
            raise StopIteration
        views = tuple(view.result() for view in self._ahead)
        length = recording_length(self._feeds)
        if length <= self._frame:
            if length < self._least:
                found = f"a recording of {length} frames"
                raise SourceError(self._recording.path, "frames", found, f"at least {self._least}")
            raise StopIteration
        moment = FrameSet(self._frame, views)
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
    recording: Recording, first: int = 0, stop: int | None = None, streams: StreamIndex | None = None
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
    return FrameReader(with_alignment(recording, streams.shown) if streams else recording, first, stop, streams)


def read_camera(
    recording: Recording, camera_index: int, frames: Iterable[int], streams: StreamIndex | None = None
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
    if streams:
        recording = with_alignment(recording, streams.shown)
    with closing(
        open_aligned_stream(recording, camera_index, streams.times[camera_index] if streams else None)
    ) as feed:
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


def _require_start(feeds: list[AlignedStream], first: int) -> None:
    for feed in feeds:
        if feed.required and first < feed.source.offset:
            raise SourceError(
                feed.source.source.path,
                f"camera {feed.camera.name}, frame {first}",
                f"a stream that starts at frame {feed.source.offset}",
                'one that shows it, or on_missing = "blind"',
            )
