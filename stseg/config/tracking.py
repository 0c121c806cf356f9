"""Constants of cuts, identities, and of recordings that are long or still go on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stseg.settings import require


@dataclass(frozen=True)
class SegmentationConfig:
    """The cut of a window's volume (METHODS 4)."""

    smoothness: float = 0.1
    """lambda: what it costs that two neighbours at no distance differ, nats."""
    distance_scale: float = 0.20
    """s: distance over which that falls to 0.6 of it, metres."""
    time_distance: float = 0.15
    """How far apart the time neighbours of one body are once its motion is followed, metres."""
    neighbours: int = 8
    """How many neighbours a cell has: 8, one step along x, y, the planes or time, or 80, the diagonals too."""
    solver: Literal["stseg", "pymaxflow"] = "stseg"
    """Solver of the minimum cuts: their labels are the same, pymaxflow is slower, and taken where numba is disabled."""

    def __post_init__(self) -> None:
        require(0 <= self.smoothness <= 16, self, "smoothness", "0 to 16 nats")
        require(self.neighbours in (8, 80), self, "neighbours", "8 or 80")
        require(self.distance_scale > 0, self, "distance_scale", "a number above 0")
        require(self.time_distance >= 0, self, "time_distance", "0 or more metres")


@dataclass(frozen=True)
class TrackingConfig:
    """Windows, and tracks out of pieces (METHODS 5)."""

    window: float = 1.0
    """Length of a window, seconds; held between 8 and 30 frames."""
    assignment_distance: float = 0.35
    """How far a place may be off besides, metres."""
    height_noise: float = 0.035
    """How far a frame's height of a person is off where they are seen whole, metres (standard deviation)."""
    width_noise: float = 0.03
    """How far a frame's width of a person is off where they are seen whole, metres (standard deviation)."""
    prediction_horizon: float = 0.6
    """How far ahead a track is carried when a window's cells are divided, seconds; beyond that it may be anywhere."""
    patience: float = 2.0
    """How long somebody may be unseen and still be the same, seconds."""
    maximum_gap: float = 4.0
    """How long somebody may be out of sight and still be known again by motion and height, seconds."""
    interpolation_gap: float = 1.0
    """How long a gap is filled on a straight line; longer ones stay gaps, seconds."""
    minimum_duration: float = 0.8
    """Tracks shorter than this are nobody, seconds (HW12's temporal check)."""
    separation_time: float = 1.0
    """How long the cells of two people are apart before their encounter is over, seconds."""

    def __post_init__(self) -> None:
        for name in ("window", "height_noise", "width_noise"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        for name in (
            "assignment_distance",
            "prediction_horizon",
            "patience",
            "maximum_gap",
            "interpolation_gap",
            "minimum_duration",
            "separation_time",
        ):
            require(getattr(self, name) >= 0, self, name, "0 or more")


@dataclass(frozen=True)
class SegmentConfig:
    """Segments: what of a long recording is worked on at once, and committed to disk."""

    length: float = 120.0
    """How much of the recording one segment holds, seconds; a killed run goes on from the last whole one."""
    warm_up: float = 6.0
    """How far before its first frame a segment begins to look, to know who is there, seconds."""
    background_period: float = 300.0
    """Where no empty scene is given, each so long part of the recording has a background of its own, seconds."""
    background_samples: int = 40
    """Frames that one is learned from, spread over that part."""

    def __post_init__(self) -> None:
        for name in ("length", "background_period"):
            require(getattr(self, name) > 0, self, name, "seconds, above 0")
        require(self.warm_up >= 0, self, "warm_up", "0 or more seconds")
        require(self.background_samples >= 1, self, "background_samples", "1 or more")


@dataclass(frozen=True)
class LiveConfig:
    """A recording that still goes on: `stseg run --follow`."""

    file_quiet_time: float = 10.0
    """A file to which nothing was added for so long is complete even if it is the last, seconds."""
    background_time: float = 60.0
    """Where a camera has no empty scene, how long it is looked at before the run begins, seconds."""
    frame_tolerance: float = 0.3
    """How far from a moment, in time, what a live camera shows still stands for it, seconds; three quarters of a frame
    at least."""
    stream_timeout: float = 5.0
    """A live stream from which nothing comes for so long is broken, seconds."""
    reconnect_wait: float = 1.0
    """How long to wait before a broken stream is asked again, seconds; each time in vain it is twice as long."""
    longest_reconnect_wait: float = 60.0
    """But no longer than this, seconds."""
    buffer_time: float = 10.0
    """How much of live streams may wait to be worked on, seconds; beyond that the oldest moments are dropped."""
    buffer_memory: float = 512.0
    """How much memory their pictures may take, MiB; beyond that, too."""

    def __post_init__(self) -> None:
        for name in (
            "file_quiet_time",
            "background_time",
            "frame_tolerance",
            "stream_timeout",
            "reconnect_wait",
            "longest_reconnect_wait",
            "buffer_time",
            "buffer_memory",
        ):
            require(getattr(self, name) > 0, self, name, "a number above 0")
