"""Synchronised frames of all cameras of a recording.

A recording's frames count from 0. A camera with offset o shows frame f of the recording in its own frame f - o, so a
positive offset is a camera that started late and a negative one a camera that started early. A camera whose
`on_missing` is "blind" sees nothing before its start and after its end; the others must be there from the first frame
that is read and must end together, which is the end of the recording (where all may be blind, the end of the longest).

Cameras whose frames are aligned by time stamps show the frame nearest in time instead, and are blind where there is
none (`stseg.io.recording.time_alignment`).
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, closing
from dataclasses import dataclass

from stseg.arrays import Observation
from stseg.errors import ConfigError, SourceError
from stseg.io.recording.aligned_stream import (
    StreamIndex,
    decoder_threads,
    open_aligned_stream,
    open_aligned_streams,
    open_image_streams,
    recording_length,
)
from stseg.io.recording.recording import Recording
from stseg.io.recording.streams import open_stream
from stseg.io.recording.time_alignment import with_alignment


@dataclass(frozen=True, slots=True)
class FrameSet:
    """The observations of all cameras at one time.

    Attributes
    ----------
    frame
        The recording's frame.
    views
        One observation per camera in the rig's order, None where a camera is blind.
    images
        Colour frames beside detections, one per camera, None where it has none; empty where none has.
    arrived
        Of live cameras: when all observations had arrived, by `stseg.io.live.live_stream.now`.
    dropped
        Whether its observations were dropped because tracking is slower than live cameras.
    """

    frame: int
    views: tuple[Observation, ...]
    images: tuple[Observation, ...] = ()
    arrived: float = 0.0
    dropped: bool = False

    def __repr__(self) -> str:
        blind = sum(view is None for view in self.views)
        return f"FrameSet(frame {self.frame}: {len(self.views)} views, {blind} of them blind)"


class FrameReader(AbstractContextManager["FrameReader"], Iterator[FrameSet]):
    """Frame sets of a recording in order; made by `open_frames`.

    One frame set is decoded ahead, each camera in its own thread, while the caller works on the last one.

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
            self._streams = open_aligned_streams(recording, opened, streams.times if streams else ())
            self._images = open_image_streams(recording, opened)
            for stream in self._streams:
                stream.require_start(first)
            self._pool = opened.enter_context(ThreadPoolExecutor(decoder_threads(recording)))
            self._opened = opened.pop_all()
        self._ahead = self._read_ahead()

    def __exit__(self, *reason: object) -> None:
        self.close()

    def __next__(self) -> FrameSet:
        if self._frame == self._stop:
            raise StopIteration
        number, read = len(self._streams), tuple(view.result() for view in self._ahead)
        views = read[:number]
        length = recording_length(self._streams)
        if length <= self._frame:
            if length < self._least:
                found = f"a recording of {length} frames"
                raise SourceError(self._recording.path, "frames", found, f"at least {self._least}")
            raise StopIteration
        frame_set = FrameSet(self._frame, views, self._beside(views, read[number:]))
        self._frame += 1
        self._ahead = self._read_ahead()
        return frame_set

    def close(self) -> None:
        """Wait for the frame that is being decoded and close all streams."""
        self._opened.close()

    def _read_ahead(self) -> list[Future[Observation]]:
        if self._frame == self._stop:
            return []
        streams = [*self._streams, *self._images.values()]
        return [self._pool.submit(stream.read, self._frame) for stream in streams]

    def _beside(self, views: Sequence[Observation], read: Sequence[Observation]) -> tuple[Observation, ...]:
        """Colour frames in the places of their cameras; each detection's frame has one."""
        if not self._images:
            return ()
        images: list[Observation] = [None] * len(views)
        for (k, stream), image in zip(self._images.items(), read, strict=True):
            if image is None and views[k] is not None:
                found = f"its end at frame {stream.end}, where the detections go on"
                place = f"camera {stream.camera.name}, images"
                raise SourceError(stream.source.source.path, place, found, "a frame for each frame of the detections")
            images[k] = image
        return tuple(images)


def open_frames(
    recording: Recording, first: int = 0, stop: int | None = None, streams: StreamIndex | None = None
) -> FrameReader:
    """Read frames first..stop-1 of a recording, all cameras together.

    SourceError, FormatError where a source is missing, empty or not of its kind, or a camera starts after the first
    frame; ConfigError where the range is none.

    Parameters
    ----------
    recording
        The rig and its streams.
    first, stop
        The recording's frames to read, half open; they keep their numbers. None: to the end.
    streams
        From `index_streams`: frames are then aligned in time, and a distant first one is sought.

    Returns
    -------
    FrameReader
        A context manager that yields one `FrameSet` per frame.
    """
    if first < 0 or (stop is not None and stop < first):
        found = f"{first}:{'' if stop is None else stop}"
        raise ConfigError(recording.path, "frames", found, "first:stop, with 0 <= first <= stop")
    return FrameReader(with_alignment(recording, streams.frame_at_tick) if streams else recording, first, stop, streams)


def read_camera(
    recording: Recording, camera_index: int, frames: Iterable[int], streams: StreamIndex | None = None
) -> Iterator[Observation]:
    """Observations of one camera in some frames of the recording, decoded on demand; None where it is blind.

    The frames rise; with `streams`, from `index_streams`, they are aligned in time and distant ones sought.
    SourceError, FormatError where the source is missing, broken or not of the camera's size.
    """
    if streams:
        recording = with_alignment(recording, streams.frame_at_tick)
    with closing(
        open_aligned_stream(recording, camera_index, streams.times[camera_index] if streams else None)
    ) as stream:
        for frame in frames:
            yield stream.read(frame)


def read_background(recording: Recording, camera_index: int) -> Iterator[Observation]:
    """One camera's frames of the empty scene, decoded on demand.

    SourceError where the camera has no background, or it is missing, broken or not of the camera's size.
    """
    camera, background = recording.rig.cameras[camera_index], recording.sources[camera_index].background
    if background is None:
        raise SourceError(recording.path, f"camera {camera.name}, background", "none", "a source of the empty scene")
    with closing(open_stream(background, camera, factor=recording.factors[camera_index])) as stream:
        while (view := stream.read()) is not None:
            yield view
