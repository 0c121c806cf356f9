"""Synchronised frames of live cameras, by the rig's frame clock.

Frame f stands for one time; a camera with offset o shows it when its pictures of o frames before that arrive. Each view
is the picture that came nearest to its time, so views are half a frame off at most, whatever the rate of a camera. The
clock is in step with the first camera, so views are not off where cameras are in step with each other.

    camera threads -> newest pictures -> the clock's thread -> moments that wait -> whoever takes them
                      (bounded)                                (bounded: the oldest lose their views)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from math import ceil
from threading import Condition, Event, Thread
from types import TracebackType
from typing import Self

from stseg.arrays import Observation
from stseg.config import LiveConfig
from stseg.io.live.live_frames import LiveFrameSet, now
from stseg.io.live.live_stream import Capture, FFmpegCapture, LiveStream, TimedPicture
from stseg.io.recording.recording import Recording

_POLL = 0.2
"""How long a wait may last before it is seen that the run was asked to stop, seconds."""
_SLACK = 0.5
"""How late the clock's thread may be without missing a picture, seconds."""
_BEFORE = 0.5
"""Between the first pictures and frame 0, so that no camera is late for it, seconds."""
_SAID = 60.0
"""How often it is said at most that moments are dropped, seconds."""
_MEBI = 1 << 20


class FollowedCameras:
    """Moments of live cameras.

    Parameters
    ----------
    recording
        The rig and its streams, all live.
    config
        How patient it is, and how much may wait.
    start
        When frame 0 was, by `stseg.io.live.live_frames.now`, if the run began before; else the clock starts when all
        cameras show something, or `config.silence` after the first does.
    halt
        Once it is set no more moments begin; what waits is given out still.
    say
        Is told, in a line, what breaks, comes back or is dropped.
    opening
        How a stream is opened.

    Attributes
    ----------
    start
        When frame 0 was; None before the first moment.
    dropped
        How many moments lost their views.

    Raises
    ------
    SourceError
        While iterating: where a camera's pictures have not its size.
    """

    def __init__(
        self,
        recording: Recording,
        config: LiveConfig,
        start: float | None,
        halt: Event,
        say: Callable[[str], None],
        opening: Callable[[str, float], Capture] = FFmpegCapture,
    ) -> None:
        rig = recording.rig
        self.start, self.dropped = start, 0
        self._halt, self._say, self._config = halt, say, config
        self._period = 1 / rig.frame_rate
        self._stale = max(config.frame_tolerance, 0.75 * self._period)
        self._offsets = [source.offset for source in recording.sources]
        spread = (max(self._offsets) - min(self._offsets)) * self._period
        kept = spread + 2 * self._stale + _SLACK
        self._most = _most_waiting(recording, config)
        self._waiting: deque[LiveFrameSet] = deque()
        self._came, self._ready = Condition(), Condition()
        self._said = -_SAID
        self._streams = [
            LiveStream(source.source, camera, 1 / rig.frame_rate, config, kept, self._came, say, opening, factor)
            for camera, source, factor in zip(rig.cameras, recording.sources, recording.factors, strict=True)
        ]
        self._clock = Thread(target=self._run_clock, name="frame clock", daemon=True)
        self._over = Event()

    def __enter__(self) -> Self:
        for thread in (*self._streams, self._clock):
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[LiveFrameSet]:
        return self

    def __next__(self) -> LiveFrameSet:
        while True:
            for stream in self._streams:
                if stream.failure is not None:
                    raise stream.failure
            with self._ready:
                if self._waiting or self._ready.wait(_POLL):
                    return self._waiting.popleft()
            if not self._clock.is_alive() and not self._waiting:
                raise StopIteration

    def close(self) -> None:
        """End all threads; one that waits for a camera ends when that speaks or is taken for broken."""
        self._over.set()
        for stream in self._streams:
            stream.close()
        for thread in (*self._streams, self._clock):
            thread.join()

    def _run_clock(self) -> None:
        """What the clock's thread does; when it ends nobody needs pictures any more."""
        try:
            self._tick()
        finally:
            for stream in self._streams:
                stream.close()

    def _tick(self) -> None:
        """Let moments wait one after the other, until the run is stopped."""
        if not self._wait_for_pictures():
            return
        if self.start is None:
            first, self.start = 0, self._in_step(now() + _BEFORE + max(0, *self._offsets) * self._period)
        else:
            first = max(0, ceil((now() + _BEFORE - self.start) / self._period))
        start = self.start
        for frame in count(first):
            at = [start + (frame - offset) * self._period for offset in self._offsets]
            views = self._views(at)
            if views is None:
                return
            self._put(LiveFrameSet(frame, views, max(at)))

    def _in_step(self, least: float) -> float:
        """The first time from then on at which the first camera that shows anything is to show a picture."""
        with self._came:
            shown = next(stream.pictures[-1].at for stream in self._streams if stream.pictures)
        return shown + ceil((least - shown) / self._period) * self._period

    def _wait_for_pictures(self) -> bool:
        """Until the clock can start; False where the run is stopped before."""
        with self._came:
            while not self._stopped():
                begun = [stream.pictures[0].at for stream in self._streams if stream.pictures]
                if len(begun) == len(self._streams) or (begun and now() > min(begun) + self._config.stream_timeout):
                    return True
                self._came.wait(_POLL)
        return False

    def _views(self, at: Sequence[float]) -> tuple[Observation, ...] | None:
        """What the cameras showed at these times, waited for; None where the run is stopped."""
        with self._came:
            while True:
                rest = max(at) + self._stale - now()
                if rest <= 0 or all(self._shows(stream, time) for stream, time in zip(self._streams, at, strict=True)):
                    return tuple(self._nearest(stream, time) for stream, time in zip(self._streams, at, strict=True))
                if self._stopped():
                    return None
                self._came.wait(min(rest, _POLL))

    def _shows(self, stream: LiveStream, time: float) -> bool:
        """Whether what comes next cannot be nearer."""
        return bool(stream.pictures) and stream.pictures[-1].at >= time

    def _nearest(self, stream: LiveStream, time: float) -> Observation:
        """What a camera showed at a time; None where nothing came near it."""

        def distance(picture: TimedPicture) -> float:
            return abs(picture.at - time)

        nearest = min(stream.pictures, key=distance, default=None)
        return None if nearest is None or distance(nearest) > self._stale else nearest.picture

    def _put(self, moment: LiveFrameSet) -> None:
        """Let a moment wait; where too many do, the oldest that still has views loses them."""
        with self._ready:
            self._waiting.append(moment)
            seen = [k for k, waits in enumerate(self._waiting) if any(view is not None for view in waits.views)]
            if len(seen) > self._most:
                oldest = self._waiting[seen[0]]
                self._waiting[seen[0]] = replace(oldest, views=(None,) * len(oldest.views), dropped=True)
                self.dropped += 1
            self._ready.notify_all()
        if len(seen) > self._most and now() - self._said > _SAID:
            self._said = now()
            told = f"{self.dropped} moments dropped so far, at frame {moment.frame}"
            self._say(f"work is slower than the cameras: {told}")

    def _stopped(self) -> bool:
        return self._halt.is_set() or self._over.is_set()


def _most_waiting(recording: Recording, config: LiveConfig) -> int:
    """How many moments may wait with their views."""
    bytes_of_one = sum(3 * camera.size[0] * camera.size[1] for camera in recording.read_rig.cameras)
    return max(2, int(min(config.buffer_time * recording.rig.frame_rate, config.buffer_memory * _MEBI / bytes_of_one)))
