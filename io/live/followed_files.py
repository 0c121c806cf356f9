"""Synchronised frame sets from video files that are still arriving. No frame is dropped.

One frame set is decoded ahead, each camera in its own thread; then reading waits for the consumer. A slow run leaves
files on the disk rather than frames in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from threading import Event
from types import TracebackType
from typing import Self

from stseg.arrays import Observation
from stseg.config import LiveConfig
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.live.arriving_files import ArrivingFiles, ArrivingVideos, FileNotes
from stseg.io.live.live_stream import LiveFrameSet
from stseg.io.recording.recording import CameraSource, Recording

_POLL = 0.2
"""Interval at which a request to stop is noticed while waiting, seconds."""


class FollowedFiles:
    """Frame sets of a recording whose videos arrive as files, a pattern each (see `stseg.io.live.live_stream.is_live`).

    Parameters
    ----------
    recording
        The rig and its streams.
    first, stop
        The frames to read, half open; stop None while they come.
    config
        When a file counts as complete.
    notes
        Files that were read before.
    halt
        Ends the iteration.
    report
        Receives a line about files that are long awaited.

    Raises
    ------
    SourceError
        Where a camera starts after the first frame, or, while iterating, where a video is broken.
    """

    def __init__(
        self,
        recording: Recording,
        first: int,
        stop: int | None,
        config: LiveConfig,
        notes: FileNotes,
        halt: Event,
        report: Callable[[str], None],
    ) -> None:
        self._frame, self._stop, self._config, self._halt, self._report = first, stop, config, halt, report
        self._over = Event()
        """Ends the threads that wait for files."""
        self._files: list[_AlignedFiles] = []
        cameras = zip(recording.rig.cameras, recording.sources, recording.factors, strict=True)
        for camera, source, factor in cameras:
            files = ArrivingFiles(source.source.path, config.file_quiet_time, self._over, report)
            self._files.append(
                _AlignedFiles(camera, source, ArrivingVideos(source.source, camera, files, notes, factor))
            )
            self._files[-1].require_start(first)
        with ExitStack() as opened:
            for feed in self._files:
                opened.callback(feed.close)
            self._pool = opened.enter_context(ThreadPoolExecutor(len(self._files)))
            opened.callback(self._over.set)
            self._opened = opened.pop_all()
        self._ahead = self._read_ahead()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[LiveFrameSet]:
        return self

    def __next__(self) -> LiveFrameSet:
        if self._frame == self._stop or not self._wait_for_frames():
            raise StopIteration
        views = tuple(view.result() for view in self._ahead)
        frame_set = LiveFrameSet(self._frame, views, max(feed.stream.arrived for feed in self._files))
        self._frame += 1
        self._ahead = self._read_ahead()
        return frame_set

    def close(self) -> None:
        """Close all files."""
        self._opened.close()

    def _wait_for_frames(self) -> bool:
        """Wait for the next frame of every camera; False where the run is asked to stop."""
        waited, reported = 0.0, False
        while not self._halt.is_set():
            done, missing = wait(self._ahead, _POLL)
            if not missing:
                return True
            waited += _POLL if done else 0.0
            if not reported and waited > self._config.file_quiet_time + self._config.stream_timeout:
                names = [
                    camera_files.camera.name
                    for camera_files, view in zip(self._files, self._ahead, strict=True)
                    if not view.done()
                ]
                self._report(f"waiting for the next file of {', '.join(names)}, at frame {self._frame}")
                reported = True
        return False

    def _read_ahead(self) -> list[Future[Observation]]:
        if self._frame == self._stop:
            return []
        return [self._pool.submit(feed.read, self._frame) for feed in self._files]


class _AlignedFiles:
    """One camera's arriving files, read by frames of the recording."""

    def __init__(self, camera: Camera, source: CameraSource, stream: ArrivingVideos) -> None:
        self.camera, self.source, self.stream = camera, source, stream
        self._next = 0

    def require_start(self, first: int) -> None:
        """Raise SourceError where a required camera starts after frame `first` of the recording."""
        if self.source.on_missing == "error" and first < self.source.offset:
            raise SourceError(
                self.source.source.path,
                f"camera {self.camera.name}, frame {first}",
                f"a stream that starts at frame {self.source.offset}",
                'one that shows it, or on_missing = "blind"',
            )

    def read(self, frame: int) -> Observation:
        """The observation at a frame, None before the stream begins; frames are read in rising order."""
        number = frame - self.source.offset
        if number < 0:
            return None
        self._next += self.stream.skip(number - self._next)
        view = self.stream.read() if self._next == number else None
        self._next += view is not None
        return view

    def close(self) -> None:
        self.stream.close()
