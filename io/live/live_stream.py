"""One live stream: an address that FFmpeg reads, asked again for as long as it takes when it breaks."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from threading import Condition, Event, Thread
from typing import NamedTuple, Protocol

import cv2

import stseg.io.recording.video_stream  # noqa: F401  # quietens FFmpeg before its first use
from stseg.arrays import AnyArray
from stseg.config import LiveConfig
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.live.live_frames import now
from stseg.io.recording.pictures import as_observation, reduced_picture
from stseg.io.recording.recording import Source, mask_passwords

_OPTIONS = "rtsp_transport;tcp|fflags;nobuffer|analyzeduration;1000000"
"""RTSP over TCP; nothing that came before is held back, and a second is enough to tell what is sent, microseconds."""


class Capture(Protocol):
    """An open live stream."""

    def read(self) -> AnyArray | None:
        """The next picture, BGR, waited for; None where the stream is broken."""

    def close(self) -> None:
        """Let it go."""


class TimedPicture(NamedTuple):
    """A picture and when it came, by `stseg.io.live.live_frames.now`."""

    at: float
    picture: AnyArray


class FFmpegCapture:
    """A stream that OpenCV's FFmpeg reads.

    Its options are those of the environment variable OPENCV_FFMPEG_CAPTURE_OPTIONS where it is set, else `_OPTIONS`.

    Raises
    ------
    OSError
        Where there is no such stream.
    """

    def __init__(self, address: str, silence: float) -> None:
        os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", _OPTIONS)
        limit = round(1000 * silence)
        # One thread: FFmpeg's threads of frames hold back a frame each.
        options = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, limit, cv2.CAP_PROP_READ_TIMEOUT_MSEC, limit]
        self._capture = cv2.VideoCapture(address, cv2.CAP_FFMPEG, [*options, cv2.CAP_PROP_N_THREADS, 1])
        if not self._capture.isOpened():
            raise OSError("no stream that FFmpeg opens")

    def read(self) -> AnyArray | None:
        """The next picture; None where nothing came in time."""
        whole, picture = self._capture.read()
        return picture if whole else None

    def close(self) -> None:
        """Let it go."""
        self._capture.release()


class LiveStream(Thread):
    """Keeps the newest pictures of one camera, and when they came.

    Parameters
    ----------
    source, camera
        The address, and the camera whose size its pictures must have.
    config
        How patient it is.
    period
        From one frame of the rig to the next, seconds.
    kept
        How long pictures are kept, seconds.
    came
        Is notified of every picture.
    say
        Is told, in a line, when the stream breaks and when it is there again.
    opening
        Opens an address, with the seconds of silence that are borne; OSError where it cannot.
    factor
        By which whole factor its pictures are reduced.
    """

    def __init__(
        self,
        source: Source,
        camera: Camera,
        period: float,
        config: LiveConfig,
        kept: float,
        came: Condition,
        say: Callable[[str], None],
        opening: Callable[[str, float], Capture] = FFmpegCapture,
        factor: int = 1,
    ) -> None:
        super().__init__(name=f"camera {camera.name}", daemon=True)
        self._source, self._camera, self._config, self._say, self._opening = source, camera, config, say, opening
        self._period, self._kept, self._factor = period, kept, factor
        self.pictures: deque[TimedPicture] = deque()
        """The newest, in the order in which they came; `came` guards them. The very newest stays."""
        self.failure: SourceError | None = None
        """What makes it useless to go on, such as pictures of another size."""
        self._came, self._over = came, Event()

    def run(self) -> None:
        """Read until `close`, over all breaks."""
        pause, broken = self._config.reconnect_wait, False
        while not self._over.is_set():
            if self._read_on(broken):
                pause, broken = self._config.reconnect_wait, False
            if self.failure is not None:
                return
            if not broken and not self._over.is_set():
                self._tell(f"nothing comes from {mask_passwords(self._source.address)}; it is blind until it does")
                broken = True
            self._over.wait(pause)
            pause = min(2 * pause, self._config.longest_reconnect_wait)

    def close(self) -> None:
        """Read no more; the thread ends when it has noticed."""
        self._over.set()

    def _read_on(self, broken: bool) -> bool:
        """Read until the stream breaks; whether anything came."""
        try:
            capture = self._opening(self._source.address, self._config.stream_timeout)
        except OSError:
            return False
        came = False
        try:
            for picture in self._pictures(capture):
                if broken and not came:
                    self._tell("it sees again")
                self._keep(picture)
                came = True
        except SourceError as error:
            self.failure = error
        finally:
            capture.close()
        return came

    def _pictures(self, capture: Capture) -> Iterator[AnyArray]:
        """What comes from now on. Servers and FFmpeg have held back a little of what was before: it is there at once,
        while for the present one has to wait."""
        opened = now()
        present = False
        while not self._over.is_set():
            asked = now()
            picture = capture.read()
            if picture is None:
                return
            present = present or now() - asked > self._period / 4 or now() - opened > self._config.stream_timeout
            if present:
                yield picture

    def _keep(self, picture: AnyArray) -> None:
        source, camera = self._source, self._camera
        view = as_observation(picture, source.kind, camera.size, source.path, f"camera {camera.name}")
        with self._came:
            self.pictures.append(TimedPicture(now(), reduced_picture(view, self._factor)))
            while self.pictures[0].at < self.pictures[-1].at - self._kept:
                self.pictures.popleft()
            self._came.notify_all()

    def _tell(self, what: str) -> None:
        self._say(f"camera {self._camera.name}: {what}")
