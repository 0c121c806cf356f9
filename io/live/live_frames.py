"""Frame sets of a recording in progress, and the clock by which they are stamped."""

from __future__ import annotations

import time
from dataclasses import dataclass

from stseg.arrays import Observation
from stseg.errors import SourceError
from stseg.io.recording.image_stream import is_pattern
from stseg.io.recording.recording import Recording

_ZERO = time.time() - time.monotonic()


def now() -> float:
    """Seconds since 1970 by a monotonic clock."""
    return _ZERO + time.monotonic()


@dataclass(frozen=True, slots=True)
class LiveFrameSet:
    """The observations of all cameras at one time.

    Attributes
    ----------
    frame
        The recording's frame.
    views
        One observation per camera in the rig's order, None where a camera is blind.
    arrived
        When all its observations had arrived, by `now`.
    dropped
        Whether its observations were dropped because tracking is slower than the cameras.
    images
        Empty: live cameras deliver no detections.
    """

    frame: int
    views: tuple[Observation, ...]
    arrived: float
    dropped: bool = False
    images: tuple[Observation, ...] = ()


def is_live(recording: Recording) -> bool:
    """Whether the cameras of a recording are live streams; False where its videos arrive as files.

    Raises
    ------
    SourceError
        Where its sources are neither, or mixed.
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
