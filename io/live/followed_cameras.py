"""Synchronised frame sets of live cameras, by a frame clock at the rig's rate.

Frame f has one nominal time; a camera with offset o shows it o frame periods earlier. Each observation is the picture
that arrived nearest to the nominal time, at most half a frame off, whatever the rate of the camera. The clock is in
phase with the first camera, so that cameras in phase with each other are not off at all.

    camera threads -> newest pictures -> clock thread -> queue of frame sets -> consumer
                      (bounded)                          (bounded: the oldest lose their observations)
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import count
from math import ceil
from threading import Condition, Event, Thread
from typing import Self

from stseg.arrays import Observation
from stseg.config import LiveConfig
from stseg.io.live.live_stream import STOP_INTERVAL, Capture, FFmpegCapture, LiveStream, TimedPicture, now
from stseg.io.recording.frames import FrameSet
from stseg.io.recording.recording import Recording

_SLACK = 0.5
"""Lateness of the clock thread up to which no picture is lost, seconds."""
_START_DELAY = 0.5
"""Delay between the first pictures and frame 0, so that every camera has one, seconds."""
_REPORT_INTERVAL = 60.0
"""Least interval between reports of dropped frame sets, seconds."""
_MEBI = 1 << 20


class FollowedCameras(AbstractContextManager["FollowedCameras"], Iterator[FrameSet]):
    """Frame sets of live cameras.

    Parameters
    ----------
    recording
        The rig and its streams, all live.
    config
        Timeouts, and the size of the queue.
    start
        Time of frame 0, by `stseg.io.live.live_stream.now`, of a resumed run; else the clock starts when all cameras
        deliver pictures, or `config.stream_timeout` after the first does.
    halt
        Stops the clock; queued frame sets are still delivered.
    report
        Receives a line about streams that break or return, and about dropped frame sets.
    connect
        Opens a stream.

    Raises
    ------
    SourceError
        While iterating: where a camera's pictures are of another size.
    """

    def __init__(
        self,
        recording: Recording,
        config: LiveConfig,
        start: float | None,
        halt: Event,
        report: Callable[[str], None],
        connect: Callable[[str, float], Capture] = FFmpegCapture,
    ) -> None:
        rig = recording.rig
        self.start, self.dropped = start, 0
        """Time of frame 0, None before the first frame set; number of frame sets whose observations were dropped."""
        self._halt, self._report, self._config = halt, report, config
        self._period = 1 / rig.frame_rate
        self._stale = max(config.frame_tolerance, 0.75 * self._period)
        self._offsets = [source.offset for source in recording.sources]
        spread = (max(self._offsets) - min(self._offsets)) * self._period
        kept = spread + 2 * self._stale + _SLACK
        self._longest_queue = _queue_length(recording, config)
        self._queue: deque[FrameSet] = deque()
        self._arrival, self._ready = Condition(), Condition()
        self._reported = -_REPORT_INTERVAL
        self._streams = [
            LiveStream(source.source, camera, 1 / rig.frame_rate, config, kept, self._arrival, report, connect, factor)
            for camera, source, factor in zip(rig.cameras, recording.sources, recording.factors, strict=True)
        ]
        self._clock = Thread(target=self._run_clock, name="frame clock", daemon=True)
        self._over = Event()

    def __enter__(self) -> Self:
        for thread in (*self._streams, self._clock):
            thread.start()
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    def __next__(self) -> FrameSet:
        while True:
            for stream in self._streams:
                if stream.failure is not None:
                    raise stream.failure
            with self._ready:
                if self._queue or self._ready.wait(STOP_INTERVAL):
                    return self._queue.popleft()
            if not self._clock.is_alive() and not self._queue:
                raise StopIteration

    def close(self) -> None:
        """End all threads; one that waits for a camera ends at its next picture or timeout."""
        self._over.set()
        for stream in self._streams:
            stream.close()
        for thread in (*self._streams, self._clock):
            thread.join()

    def _run_clock(self) -> None:
        """Run the clock thread; when it ends all streams are closed."""
        try:
            self._tick()
        finally:
            for stream in self._streams:
                stream.close()

    def _tick(self) -> None:
        """Queue one frame set after the other, until the run is stopped."""
        if not self._wait_for_pictures():
            return
        if self.start is None:
            first, self.start = 0, self._in_phase(now() + _START_DELAY + max(0, *self._offsets) * self._period)
        else:
            first = max(0, ceil((now() + _START_DELAY - self.start) / self._period))
        start = self.start
        for frame in count(first):
            at = [start + (frame - offset) * self._period for offset in self._offsets]
            views = self._views(at)
            if views is None:
                return
            self._put(FrameSet(frame, views, arrived=max(at)))

    def _in_phase(self, least: float) -> float:
        """The first time from `least` on that is in phase with the pictures of the first camera that delivers."""
        with self._arrival:
            latest = next(stream.pictures[-1].at for stream in self._streams if stream.pictures)
        return latest + ceil((least - latest) / self._period) * self._period

    def _wait_for_pictures(self) -> bool:
        """Wait until the clock can start; False where the run is stopped before."""
        with self._arrival:
            while not self._stopped():
                first_times = [stream.pictures[0].at for stream in self._streams if stream.pictures]
                if len(first_times) == len(self._streams) or (
                    first_times and now() > min(first_times) + self._config.stream_timeout
                ):
                    return True
                self._arrival.wait(STOP_INTERVAL)
        return False

    def _views(self, at: Sequence[float]) -> tuple[Observation, ...] | None:
        """Wait for the cameras' observations at these times; None where the run is stopped."""
        with self._arrival:
            while True:
                rest, streams = max(at) + self._stale - now(), list(zip(self._streams, at, strict=True))
                has_passed = (stream.pictures and stream.pictures[-1].at >= time for stream, time in streams)
                if rest <= 0 or all(has_passed):  # later pictures cannot be nearer to the times
                    return tuple(self._nearest(stream, time) for stream, time in streams)
                if self._stopped():
                    return None
                self._arrival.wait(min(rest, STOP_INTERVAL))

    def _nearest(self, stream: LiveStream, time: float) -> Observation:
        """A camera's picture at a time; None where none arrived near it."""

        def distance(picture: TimedPicture) -> float:
            return abs(picture.at - time)

        nearest = min(stream.pictures, key=distance, default=None)
        return None if nearest is None or distance(nearest) > self._stale else nearest.picture

    def _put(self, frame_set: FrameSet) -> None:
        """Queue a frame set; where too many wait, the oldest with observations loses them."""
        with self._ready:
            self._queue.append(frame_set)
            filled = [k for k, waits in enumerate(self._queue) if any(view is not None for view in waits.views)]
            if len(filled) > self._longest_queue:
                oldest = self._queue[filled[0]]
                self._queue[filled[0]] = replace(oldest, views=(None,) * len(oldest.views), dropped=True)
                self.dropped += 1
            self._ready.notify_all()
        if len(filled) > self._longest_queue and now() - self._reported > _REPORT_INTERVAL:
            self._reported = now()
            dropped = f"{self.dropped} frame sets dropped so far, at frame {frame_set.frame}"
            self._report(f"tracking is slower than the cameras: {dropped}")

    def _stopped(self) -> bool:
        return self._halt.is_set() or self._over.is_set()


def _queue_length(recording: Recording, config: LiveConfig) -> int:
    """Number of frame sets that may wait with their observations."""
    bytes_of_one = sum(3 * camera.size[0] * camera.size[1] for camera in recording.reduced_rig.cameras)
    return max(2, int(min(config.buffer_time * recording.rig.frame_rate, config.buffer_memory * _MEBI / bytes_of_one)))
