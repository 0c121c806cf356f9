"""Synchronised frames of all cameras from files that are still arriving. Nothing is ever left out.

One frame is decoded ahead, every camera in its own thread; then reading waits for whoever takes the moments, so a slow
run makes files wait on the disk rather than frames in memory.
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
from stseg.io.live.live_frames import LiveFrameSet
from stseg.io.recording.pictures import reduced_view
from stseg.io.recording.recording import CameraSource, Recording

_POLL = 0.2
"""How long a wait may last before it is seen that the run was asked to stop, seconds."""


class FollowedFiles:
    """Frame sets of a recording whose videos arrive as files, a pattern each (see `stseg.io.live.live_frames.is_live`).

    Parameters
    ----------
    recording
        The rig and its streams.
    first, stop
        The frames to read, half open; stop None while they come.
    config
        When a file is complete.
    notes
        Which files were read before.
    halt
        Once it is set, the moment that was given last was the last one.
    say
        Is told, in a line, what is waited for.

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
        say: Callable[[str], None],
    ) -> None:
        self._frame, self._stop, self._config, self._halt, self._say = first, stop, config, halt, say
        self._over = Event()
        """Set for the threads that wait for files, when this is closed."""
        self._feeds: list[_AlignedFiles] = []
        cameras = zip(recording.rig.cameras, recording.sources, recording.factors, strict=True)
        for camera, source, factor in cameras:
            files = ArrivingFiles(source.source.path, config.file_quiet_time, self._over, say)
            self._feeds.append(
                _AlignedFiles(camera, source, ArrivingVideos(source.source, camera, files, notes), factor)
            )
            self._feeds[-1].require_start(first)
        with ExitStack() as opened:
            for feed in self._feeds:
                opened.callback(feed.close)
            self._pool = opened.enter_context(ThreadPoolExecutor(len(self._feeds)))
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
        if self._frame == self._stop or not self._come():
            raise StopIteration
        views = tuple(view.result() for view in self._ahead)
        moment = LiveFrameSet(self._frame, views, max(feed.stream.arrived for feed in self._feeds))
        self._frame += 1
        self._ahead = self._read_ahead()
        return moment

    def close(self) -> None:
        """Let all files go."""
        self._opened.close()

    def _come(self) -> bool:
        """Wait for the next frame of every camera; False where the run is asked to stop meanwhile."""
        waited, said = 0.0, False
        while not self._halt.is_set():
            some, missing = wait(self._ahead, _POLL)
            if not missing:
                return True
            waited += _POLL if some else 0.0
            if not said and waited > self._config.file_quiet_time + self._config.stream_timeout:
                names = [
                    feed.camera.name for feed, view in zip(self._feeds, self._ahead, strict=True) if not view.done()
                ]
                self._say(f"waiting for the next file of {', '.join(names)}, at frame {self._frame}")
                said = True
        return False

    def _read_ahead(self) -> list[Future[Observation]]:
        if self._frame == self._stop:
            return []
        return [self._pool.submit(feed.read, self._frame) for feed in self._feeds]


class _AlignedFiles:
    """A stream that is asked for frames of the recording rather than its own."""

    def __init__(self, camera: Camera, source: CameraSource, stream: ArrivingVideos, factor: int) -> None:
        self.camera, self.source, self.stream, self._factor = camera, source, stream, factor
        self._next = 0

    def require_start(self, first: int) -> None:
        """Raise SourceError where the camera must show the recording's frame `first` and begins after it."""
        if self.source.on_missing == "error" and first < self.source.offset:
            raise SourceError(
                self.source.source.path,
                f"camera {self.camera.name}, frame {first}",
                f"a stream that starts at frame {self.source.offset}",
                'one that shows it, or on_missing = "blind"',
            )

    def read(self, frame: int) -> Observation:
        """The view at a frame not before the last one asked for; None before the stream begins."""
        own = frame - self.source.offset
        if own < 0:
            return None
        self._next += self.stream.skip(own - self._next)
        view = self.stream.read() if self._next == own else None
        self._next += view is not None
        return reduced_view(view, self._factor)

    def close(self) -> None:
        self.stream.close()
