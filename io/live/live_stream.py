"""One live stream, read by FFmpeg and reconnected as long as it takes when it breaks; the clock of live frames."""

import re
import time
from collections import deque
from collections.abc import Callable, Iterator
from threading import Condition, Event, Thread
from typing import NamedTuple, Protocol

import cv2

from stseg.arrays import AnyArray
from stseg.config import LiveConfig
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.pictures import picture_observation, reduced_picture
from stseg.io.recording.recording import Recording, Source, mask_passwords
from stseg.io.recording.source_files import is_pattern
from stseg.io.recording.video.ffmpeg import ffmpeg_options

STOP_INTERVAL = 0.2
"""Interval at which a request to stop is noticed while waiting, seconds."""
_PROTOCOLS = "rtsp,rtsps,rtp,srtp,rtmp,rtmps,rtmpt,srt,udp,tcp,tls,http,https,httpproxy,crypto"
_OPTIONS = f"rtsp_transport;tcp|fflags;nobuffer|analyzeduration;1000000|protocol_whitelist;{_PROTOCOLS}"
"""RTSP over TCP, without buffering; one second (in microseconds) to probe the format; no local files."""

_ADDRESS = re.compile(r"(rtsps?|rtmps?|https?|srt|udp|tcp|rtp)://[^\s\x00-\x1f]+\Z", re.ASCII | re.IGNORECASE)
"""Addresses that are opened; above all, none of files and pipes."""
_ZERO = time.time() - time.monotonic()


class Capture(Protocol):
    """An open live stream."""

    def read(self) -> AnyArray | None:
        """Wait for the next picture, BGR; None where the stream is broken."""

    def close(self) -> None:
        """Close it."""


class TimedPicture(NamedTuple):
    """A picture and its time of arrival, by `stseg.io.live.live_stream.now`."""

    at: float
    picture: AnyArray


class FFmpegCapture:
    """A stream that OpenCV's FFmpeg reads.

    Its options are those of the environment variable OPENCV_FFMPEG_CAPTURE_OPTIONS where it is set, else `_OPTIONS`.

    OSError where there is no such stream.
    """

    def __init__(self, address: str, silence: float) -> None:
        if not _ADDRESS.match(address):
            raise OSError("no address of a live stream")
        limit = round(1000 * silence)
        # One thread: each of FFmpeg's frame threads delays the stream by a frame.
        options = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, limit, cv2.CAP_PROP_READ_TIMEOUT_MSEC, limit]
        with ffmpeg_options(_OPTIONS, is_default=True):
            self._capture = cv2.VideoCapture(address, cv2.CAP_FFMPEG, [*options, cv2.CAP_PROP_N_THREADS, 1])
        if not self._capture.isOpened():
            raise OSError("no stream that FFmpeg opens")

    def read(self) -> AnyArray | None:
        """The next picture; None where none arrived in time."""
        whole, picture = self._capture.read()
        return picture if whole else None

    def close(self) -> None:
        """Close it."""
        self._capture.release()


class LiveStream(Thread):
    """A thread that keeps the newest pictures of one camera with their times of arrival.

    Parameters
    ----------
    source, camera
        The address, and the camera whose size its pictures must have.
    config
        Timeouts.
    period
        Frame period of the rig, seconds.
    kept
        How long pictures are kept, seconds.
    arrival
        Notified of every picture.
    report
        Receives a line when the stream breaks and when it is back.
    connect
        Opens an address, given the longest silence in seconds; raises OSError where it cannot.
    factor
        Whole factor by which its pictures are reduced.
    """

    def __init__(
        self,
        source: Source,
        camera: Camera,
        period: float,
        config: LiveConfig,
        kept: float,
        arrival: Condition,
        report: Callable[[str], None],
        connect: Callable[[str, float], Capture] = FFmpegCapture,
        factor: int = 1,
    ) -> None:
        super().__init__(name=f"camera {camera.name}", daemon=True)
        self._source, self._camera, self._config = source, camera, config
        self._report, self._connect = report, connect
        self._period, self._kept, self._factor = period, kept, factor
        self.pictures: deque[TimedPicture] = deque()
        """The newest pictures in order of arrival, guarded by `arrival`; the last one is always kept."""
        self.failure: SourceError | None = None
        """An error after which reading stops, such as pictures of another size."""
        self._arrival, self._closed = arrival, Event()

    def run(self) -> None:
        """Read until `close`, reconnecting after each break."""
        pause, broken = self._config.reconnect_wait, False
        while not self._closed.is_set():
            if self._read_until_break(broken):
                pause, broken = self._config.reconnect_wait, False
            if self.failure is not None:
                return
            if not broken and not self._closed.is_set():
                self._notify(f"no pictures from {mask_passwords(self._source.address)}; it is blind until they return")
                broken = True
            self._closed.wait(pause)
            pause = min(2 * pause, self._config.longest_reconnect_wait)

    def close(self) -> None:
        """Ask the thread to end."""
        self._closed.set()

    def _read_until_break(self, broken: bool) -> bool:
        """Read until the stream breaks; return whether any picture arrived."""
        try:
            capture = self._connect(self._source.address, self._config.stream_timeout)
        except OSError:
            return False
        arrived = False
        try:
            for picture in self._pictures(capture):
                if broken and not arrived:
                    self._notify("the stream is back")
                self._keep(picture)
                arrived = True
        except SourceError as error:
            self.failure = error
        finally:
            capture.close()
        return arrived

    def _pictures(self, capture: Capture) -> Iterator[AnyArray]:
        """Pictures from the present on. Those that servers and FFmpeg had buffered before arrive at once, while present
        ones take a part of a frame period."""
        opened = now()
        present = False
        while not self._closed.is_set():
            started = now()
            picture = capture.read()
            if picture is None:
                return
            present = present or now() - started > self._period / 4 or now() - opened > self._config.stream_timeout
            if present:
                yield picture

    def _keep(self, picture: AnyArray) -> None:
        source, camera = self._source, self._camera
        view = picture_observation(picture, source.kind, camera.size, source.path, f"camera {camera.name}")
        with self._arrival:
            self.pictures.append(TimedPicture(now(), reduced_picture(view, self._factor)))
            while self.pictures[0].at < self.pictures[-1].at - self._kept:
                self.pictures.popleft()
            self._arrival.notify_all()

    def _notify(self, what: str) -> None:
        self._report(f"camera {self._camera.name}: {what}")


def now() -> float:
    """Seconds since 1970 by a monotonic clock."""
    return _ZERO + time.monotonic()


def is_live(recording: Recording) -> bool:
    """Whether the cameras of a recording are live streams; False where its videos arrive as files.

    SourceError where its sources are neither, or mixed.
    """
    sources = [source.source for source in recording.sources]
    live = any(source.address for source in sources)
    for camera, source in zip(recording.rig.cameras, sources, strict=True):
        key = f"camera {camera.name}"
        if live and not source.address:
            raise SourceError(source.path, key, "files beside live streams", "all cameras live, or none")
        if not live and (source.kind not in ("video", "masks") or source.more or not is_pattern(source.path)):
            found = f"{len(source.more) + 1} paths" if source.more else f"kind {source.kind}, path {source.path.name}"
            raise SourceError(source.path, key, found, "videos by a pattern (cam1_*.mp4), or an address (rtsp://...)")
    return live
