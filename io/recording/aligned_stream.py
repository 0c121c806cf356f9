"""Cameras' streams, asked for frames of the recording: what each shows then, and where they end.

A camera with offset o shows frame f of the recording in its own frame f - o, or where its frames are placed in time
(`stseg.io.recording.time_alignment`) in the one that was taken nearest to then.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import ExitStack

from stseg.arrays import Floats, Observation
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.pictures import reduced_view
from stseg.io.recording.recording import CameraSource, Recording
from stseg.io.recording.streams import Stream, open_stream


class AlignedStream:
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


def open_aligned_stream(
    recording: Recording, camera_index: int, times: Sequence[Floats] | None = None
) -> AlignedStream:
    """One camera's stream, placed as the recording says; with the times of its frames, far ones are sought.

    Raises
    ------
    SourceError, FormatError
        Where the source is missing, empty or not of its kind.
    """
    camera, source = recording.rig.cameras[camera_index], recording.sources[camera_index]
    return AlignedStream(camera, source, open_stream(source.source, camera, times), recording.factors[camera_index])


def open_aligned_streams(
    recording: Recording, opened: ExitStack, times: Sequence[Sequence[Floats]] = ()
) -> list[AlignedStream]:
    """All cameras' streams, in the rig's order, closed with `opened`; raises as `open_aligned_stream` does."""
    feeds = list[AlignedStream]()
    for camera_index in range(len(recording.sources)):
        feeds.append(open_aligned_stream(recording, camera_index, times[camera_index] if times else None))
        opened.callback(feeds[-1].close)
    return feeds


def decoder_threads(recording: Recording) -> int:
    """As many threads as decode at once: one a camera, no more than there are cores."""
    return max(1, min(len(recording.sources), os.cpu_count() or 1))


def recording_length(feeds: list[AlignedStream]) -> float:
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


def _end(feed: AlignedStream) -> float:
    return feed.end
