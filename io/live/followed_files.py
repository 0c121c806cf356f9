"""Synchronised frame sets from video files that are still arriving. No frame is dropped.

One frame set is decoded ahead, each camera in its own thread; then reading waits for the consumer. A slow run leaves
files on the disk rather than frames in memory.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack
from threading import Event

from stseg.arrays import Observation
from stseg.config import LiveConfig
from stseg.io.live.arriving_files import ArrivingFiles, ArrivingVideos, FileNotes
from stseg.io.live.live_stream import STOP_INTERVAL
from stseg.io.recording.aligned_stream import AlignedStream
from stseg.io.recording.frames import FrameSet
from stseg.io.recording.recording import Recording


class FollowedFiles(AbstractContextManager["FollowedFiles"], Iterator[FrameSet]):
    """Frame sets of a recording whose videos arrive as files, a pattern each (see `stseg.io.live.live_stream.is_live`).

    The frames are `first` to `stop`, half open; `stop` is None while they come. `config` says when a file counts as
    complete, `notes` which files were read before. `halt` ends the iteration; `report` receives a line about files
    that are long awaited. SourceError where a camera starts after the first frame or, while iterating, where a video
    is broken.
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
        self._videos: list[ArrivingVideos] = []
        self._streams: list[AlignedStream] = []
        cameras = zip(recording.rig.cameras, recording.sources, recording.factors, strict=True)
        for camera, source, factor in cameras:
            files = ArrivingFiles(source.source.path, config.file_quiet_time, self._over, report)
            self._videos.append(ArrivingVideos(source.source, camera, files, notes, factor))
            self._streams.append(AlignedStream(camera, source, self._videos[-1]))
            self._streams[-1].require_start(first)
        with ExitStack() as opened:
            for stream in self._streams:
                opened.callback(stream.close)
            self._pool = opened.enter_context(ThreadPoolExecutor(len(self._streams)))
            opened.callback(self._over.set)
            self._opened = opened.pop_all()
        self._ahead = self._read_ahead()

    def __exit__(self, *reason: object) -> None:
        self.close()

    def __next__(self) -> FrameSet:
        if self._frame == self._stop or not self._wait_for_frames():
            raise StopIteration
        views = tuple(view.result() for view in self._ahead)
        frame_set = FrameSet(self._frame, views, arrived=max(videos.arrived for videos in self._videos))
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
            done, missing = wait(self._ahead, STOP_INTERVAL)
            if not missing:
                return True
            waited += STOP_INTERVAL if done else 0.0
            if not reported and waited > self._config.file_quiet_time + self._config.stream_timeout:
                pairs = zip(self._streams, self._ahead, strict=True)
                names = [stream.camera.name for stream, view in pairs if not view.done()]
                self._report(f"waiting for the next file of {', '.join(names)}, at frame {self._frame}")
                reported = True
        return False

    def _read_ahead(self) -> list[Future[Observation]]:
        if self._frame == self._stop:
            return []
        return [self._pool.submit(stream.read, self._frame) for stream in self._streams]
