"""Streams addressed by frames of the recording instead of their own, and the index of all of them.

A camera with offset o shows frame f of the recording in its own frame f - o or, where its frames are aligned in time
(`stseg.io.recording.time_alignment`), in the frame taken nearest to it. The length of a recording and the time stamps
of its frames are found by reading all streams to their ends.
"""

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from stseg.arrays import Floats, Ints, Observation
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.recording import CameraSource, Recording
from stseg.io.recording.streams import CountedStream, Stream, open_stream
from stseg.io.recording.time_alignment import align_in_time, visible_ranges, with_alignment
from stseg.io.recording.video.time_stamps import pack_stamps, unpack_stamps


class AlignedStream:
    """One camera's stream, read by frames of the recording."""

    def __init__(self, camera: Camera, source: CameraSource, stream: Stream) -> None:
        self.camera, self.source, self._stream = camera, source, stream
        self._next = 0
        self._last: Observation = None
        self.end = math.inf
        """The recording's frame at which the stream ended; infinite while its end is unknown."""

    @property
    def required(self) -> bool:
        """Whether the camera must show every frame."""
        return self.source.on_missing == "error"

    def require_start(self, first: int) -> None:
        """Raise SourceError where a required camera starts after frame `first` of the recording."""
        if self.required and first < self.source.offset:
            place, expected = f"camera {self.camera.name}, frame {first}", 'one that shows it, or on_missing = "blind"'
            found = f"a stream that starts at frame {self.source.offset}"
            raise SourceError(self.source.source.path, place, found, expected)

    def read(self, frame: int) -> Observation:
        """The observation at a frame, None where the camera is blind; frames are read in rising order."""
        tick, frame_at_tick = frame - self.source.offset, self.source.frame_at_tick
        if tick < 0 or self.end < math.inf:
            return None
        if frame_at_tick is None:
            return self._own(tick)
        if tick >= len(frame_at_tick):
            self.end = len(frame_at_tick) + self.source.offset
            return None
        number = int(frame_at_tick[tick])
        if number >= self._next:
            self._last = self._own(number)
        return None if number < 0 else self._last

    def _own(self, number: int) -> Observation:
        """One of the stream's own frames, in rising order."""
        self._next += self._stream.skip(number - self._next)
        view = self._stream.read() if self._next == number else None
        if view is None:
            self.end = self._next + self.source.offset
        else:
            self._next += 1
        return view

    def read_times(self) -> tuple[Floats, ...]:
        """Skip all frames and return their time stamps, milliseconds."""
        return tuple(self._stream.times())

    def align(self, source: CameraSource, frames: int) -> None:
        """Set the alignment of the stream's frames, and so its end."""
        self.source = source
        self.end = source.offset + (frames if source.frame_at_tick is None else len(source.frame_at_tick))

    def filled_frames(self) -> Ints | None:
        """Frames of the recording in which the stream holds a detection, rising; None where that is not known."""
        frames = self._stream.filled if isinstance(self._stream, CountedStream) else None
        return None if frames is None or self.source.frame_at_tick is not None else frames + self.source.offset

    def close(self) -> None:
        self._stream.close()


def open_aligned_stream(
    recording: Recording, camera_index: int, times: Sequence[Floats] | None = None
) -> AlignedStream:
    """One camera's stream, aligned as the recording says; with `times` known, distant frames are sought.

    SourceError, FormatError where the source is missing, empty or not of its kind.
    """
    camera, source = recording.rig.cameras[camera_index], recording.sources[camera_index]
    stream = open_stream(source.source, camera, times, recording.factors[camera_index])
    return AlignedStream(camera, source, stream)


def open_aligned_streams(
    recording: Recording, opened: ExitStack, times: Sequence[Sequence[Floats]] = ()
) -> list[AlignedStream]:
    """All cameras' streams, in the rig's order, closed with `opened`; raises as `open_aligned_stream` does."""
    streams = list[AlignedStream]()
    for camera_index in range(len(recording.sources)):
        streams.append(open_aligned_stream(recording, camera_index, times[camera_index] if times else None))
        opened.callback(streams[-1].close)
    return streams


def open_image_streams(recording: Recording, opened: ExitStack) -> dict[int, AlignedStream]:
    """Streams of colour frames beside detections, by the number of the camera, closed with `opened`.

    Their frame k belongs to frame k of the detections. Raises as `open_aligned_stream` does.
    """
    streams = dict[int, AlignedStream]()
    for k, (camera, source) in enumerate(zip(recording.rig.cameras, recording.sources, strict=True)):
        if source.images is not None:
            images = replace(source, source=source.images, images=None)
            streams[k] = AlignedStream(camera, images, open_stream(source.images, camera))
            opened.callback(streams[k].close)
    return streams


def decoder_threads(recording: Recording) -> int:
    """Number of decoding threads: one a camera, at most one a core."""
    return max(1, min(len(recording.sources), os.cpu_count() or 1))


def recording_length(streams: list[AlignedStream]) -> float:
    """The end of the recording, infinite while unknown. SourceError where required streams do not end together."""
    required = [stream for stream in streams if stream.required]
    if not required:
        return max(stream.end for stream in streams)
    shortest, longest = min(required, key=attrgetter("end")), max(required, key=attrgetter("end"))
    if shortest.end < longest.end:
        by_time = any(stream.source.frame_at_tick is not None for stream in (shortest, longest))
        raise SourceError(
            shortest.source.source.path,
            f"camera {shortest.camera.name}",
            f"its end at frame {shortest.end}, where others continue",
            f'frames as long as camera {longest.camera.name}\'s, or on_missing = "blind"'
            + (', or clock = "count" where time stamps were used' if by_time else ""),
        )
    return shortest.end


@dataclass(frozen=True)
class StreamIndex:
    """Length and time stamps of a recording's streams, read to their ends."""

    length: int
    """Frames of the recording."""
    times: tuple[tuple[Floats, ...], ...]
    """float64 (n,) each: time stamps of all frames of each file of each camera, milliseconds; nan where there is
    none."""
    frame_at_tick: tuple[Ints | None, ...] = ()
    """int64 (tick,) or None each: `CameraSource.frame_at_tick` of each camera."""
    notes: tuple[str, ...] = ()
    """Messages for the user, one line each."""
    filled: tuple[tuple[int, int], ...] | None = None
    """Half-open stretches beyond which no camera has a detection; None where that is not known."""

    def __reduce__(self) -> tuple[Any, ...]:
        packed = tuple(tuple(map(pack_stamps, files)) for files in self.times)
        return _unpacked, (self.length, packed, self.frame_at_tick, self.notes, self.filled)

    def visible_ranges(self, recording: Recording) -> list[Ints]:
        """The frames of the indexed recording that each camera shows, half-open ranges, int64 (range, 2)."""
        counts = [sum(map(len, files)) for files in self.times]
        return visible_ranges(with_alignment(recording, self.frame_at_tick), counts, self.length)

    def filled_ranges(self, recording: Recording) -> list[Ints]:
        """As `visible_ranges`, without long stretches in which no camera has a detection."""
        ranges = self.visible_ranges(recording)
        return [np.clip(one, *within) for one in ranges for within in self.filled or [(0, self.length)]]

    def multi_view_range(self, recording: Recording) -> tuple[int, int]:
        """First and stop of the part that at least two cameras show; all of it where a camera is required throughout.

        A single view hardly locates anybody, so the beginning and end that only one camera shows are left out.
        """
        if any(source.on_missing == "error" for source in recording.sources):
            return 0, self.length
        edges = np.concatenate(self.visible_ranges(recording)).ravel()
        frames, places = np.unique(edges, return_inverse=True)
        views = np.cumsum(np.bincount(places.ravel(), np.resize([1, -1], len(edges)), len(frames)))
        multiple = np.flatnonzero(views >= min(2, len(recording.sources)))
        return (int(frames[multiple[0]]), int(frames[multiple[-1] + 1])) if len(multiple) else (0, self.length)


def _unpacked(length: int, times: Sequence[Sequence[Floats]], *rest: Any) -> StreamIndex:
    return StreamIndex(length, tuple(tuple(map(unpack_stamps, files)) for files in times), *rest)


def require_own_sources(recording: Recording) -> None:
    """Raise SourceError where two cameras have one source; `select` or `view` names a camera's part of a file."""
    cameras, sources = recording.rig.cameras, [feed.source for feed in recording.sources]
    for camera, source in zip(cameras, sources, strict=True):
        other = cameras[sources.index(source)]
        if other is not camera and not source.address:
            expected = "a file of its own" + (", or its part by select or view" if source.kind == "boxes" else "")
            found = f"the source of camera {other.name} too"
            raise SourceError(source.path, f"camera {camera.name}", found, expected)


def index_streams(recording: Recording) -> StreamIndex:
    """Index a recording: its number of frames, their stamps and the alignment of its cameras, by decoding all.

    SourceError, FormatError where a source is missing, empty or not of its kind, or that of another camera, too, or the
    streams do not end together.
    """
    require_own_sources(recording)
    with ExitStack() as opened:
        streams = open_aligned_streams(recording, opened)
        pool = opened.enter_context(ThreadPoolExecutor(decoder_threads(recording)))
        times = tuple(counted.result() for counted in [pool.submit(_read_times, stream) for stream in streams])
        return index_from_times(recording, times, streams)


def _read_times(stream: AlignedStream) -> tuple[Floats, ...]:
    """The time stamps of a stream, or of the images beside it where those count, milliseconds."""
    timed = stream.source.timed
    if timed is stream.source.source:
        return stream.read_times()
    with closing(open_stream(timed, stream.camera)) as images:
        return tuple(images.times())


def index_from_times(
    recording: Recording, times: Sequence[Sequence[Floats]], streams: list[AlignedStream] | None = None
) -> StreamIndex:
    """The index of a recording whose time stamps are known, float64 (n,) each; raises as `index_streams` does."""
    alignment = align_in_time(recording, times)
    aligned = with_alignment(recording, alignment.frame_at_tick)
    with ExitStack() as opened:
        streams = streams or open_aligned_streams(recording, opened)
        for stream, source, files in zip(streams, aligned.sources, times, strict=True):
            stream.align(source, sum(map(len, files)))
        length, filled = int(recording_length(streams)), _filled_stretches(streams, recording.rig.frame_rate)
    return StreamIndex(length, tuple(map(tuple, times)), alignment.frame_at_tick, alignment.notes, filled)


def _filled_stretches(streams: Sequence[AlignedStream], frame_rate: float) -> tuple[tuple[int, int], ...] | None:
    """Stretches with detections, an hour or more apart, and a minute before and after each; None if not known."""
    found, minute = [stream.filled_frames() for stream in streams], round(60 * frame_rate)
    known = [frames for frames in found if frames is not None]
    if len(known) < len(found) or not any(map(len, known)):
        return None
    frames = np.unique(np.concatenate(known))
    last = np.append(np.diff(frames) >= 60 * minute, True)
    begins, ends = frames[np.roll(last, 1)] - minute, frames[last] + minute + 1
    return tuple(zip(np.maximum(begins, 0).tolist(), ends.tolist(), strict=True))
