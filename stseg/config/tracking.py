"""Constants of segmentation, tracking, and of long and live recordings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stseg.config.ranges import require


@dataclass(frozen=True)
class SegmentationConfig:
    """Minimum cut of a window's volume (how-it-works, Energy)."""

    smoothness: float = 0.4
    """lambda: cost of different labels of two adjacent cells, nats."""
    distance_scale: float = 0.20
    """s: distance of two cells at which that cost has fallen to 0.6, metres."""
    time_distance: float = 0.15
    """Distance assigned to neighbours in time after motion compensation, metres."""
    neighbours: int = 8
    """Neighbours of a cell: 8 (one step along x, y, plane or time) or 80 (diagonals as well)."""
    solver: Literal["stseg", "pymaxflow"] = "stseg"
    """Solver of the minimum cuts: their labels are the same, pymaxflow is slower, and taken where numba is disabled."""

    def __post_init__(self) -> None:
        require(0 <= self.smoothness <= 16, self, "smoothness", "0 to 16 nats")
        require(self.neighbours in (8, 80), self, "neighbours", "8 or 80")
        require(self.distance_scale > 0, self, "distance_scale", "a number above 0")
        require(self.time_distance >= 0, self, "time_distance", "0 or more metres")


@dataclass(frozen=True)
class TrackingConfig:
    """Windows, and tracks from tracklets (how-it-works, Tracks)."""

    window: float = 1.0
    """Length of a window, seconds; held between 8 and 30 frames. Tracks are final one window and
    `context` later."""
    context: float = 1.0
    """Time before and after a window that counts, too, when it is decided who is real, seconds; at most 30 frames."""
    assignment_distance: float = 0.35
    """Distance below which two observations may be the same person in adjacent frames, metres."""
    height_noise: float = 0.035
    """Error of one frame's height of a fully visible person, metres (standard deviation)."""
    width_noise: float = 0.03
    """Error of one frame's width of a fully visible person, metres (standard deviation)."""
    prediction_horizon: float = 0.6
    """Time for which a track is extrapolated while the cells of a window are assigned, seconds."""
    patience: float = 2.0
    """How long a person may go undetected before the track ends, seconds."""
    maximum_gap: float = 4.0
    """Longest gap across which two tracklets may be joined by motion and height, seconds."""
    hypotheses: int = 400
    """Joint hypotheses of all identities that are kept: more are slower, and right more often in crowds."""
    identity_lag: float = 60.0
    """Time after which the identities of the best hypothesis are final, seconds."""
    appearance: Literal["learned", "none"] = "learned"
    """Use of colours and of a detector's features for identities: as much as they tell in the recording, or none; with
    none, nothing of them is stored."""
    return_probability: float = 1.0
    """Least probability, by sizes and appearance, at which somebody who comes back takes the id of the earlier visit;
    1 for never: whoever comes is new."""
    interpolation_gap: float = 1.0
    """Longest gap that is filled with interpolated positions, seconds."""
    minimum_duration: float = 0.8
    """Tracks shorter than this are dropped, seconds (HW12's temporal check)."""
    separation_time: float = 1.0
    """Time for which the cells of two people must stay apart to end their encounter, seconds."""

    def __post_init__(self) -> None:
        for name in ("window", "height_noise", "width_noise", "identity_lag"):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(1 <= self.hypotheses <= 100_000, self, "hypotheses", "1 to 100000")
        require(0.5 <= self.return_probability <= 1, self, "return_probability", "0.5 to 1")
        for name in (
            "assignment_distance",
            "prediction_horizon",
            "patience",
            "maximum_gap",
            "context",
            "interpolation_gap",
            "minimum_duration",
            "separation_time",
        ):
            require(getattr(self, name) >= 0, self, name, "0 or more")


@dataclass(frozen=True)
class SegmentConfig:
    """Segments: parts of a long recording that are worked on, and written to disk, one by one."""

    length: float = 120.0
    """Length of a segment, seconds; a run that was killed resumes after the last complete one."""
    warm_up: float = 6.0
    """Time before its first frame from which a segment observes, seconds, to know who is present."""
    background_period: float = 300.0
    """Without an empty scene, each such part of the recording has its own background, seconds."""
    background_samples: int = 40
    """Frames from which such a background is learned."""

    def __post_init__(self) -> None:
        for name in ("length", "background_period"):
            require(getattr(self, name) > 0, self, name, "seconds, above 0")
        require(self.warm_up >= 0, self, "warm_up", "0 or more seconds")
        require(self.background_samples >= 1, self, "background_samples", "1 or more")


@dataclass(frozen=True)
class LiveConfig:
    """Recordings that still go on: `stseg run --follow`."""

    file_quiet_time: float = 10.0
    """Time without new data after which the newest file counts as complete, seconds."""
    background_time: float = 60.0
    """Time for which a live camera without an empty scene is observed before the run begins, seconds."""
    frame_tolerance: float = 0.3
    """Largest time difference at which a live image stands for a frame, seconds; at least 3/4 of a frame."""
    stream_timeout: float = 5.0
    """Time without data after which a live stream counts as broken, seconds."""
    reconnect_wait: float = 1.0
    """Wait before a broken stream is opened again, seconds; doubled after every failure."""
    longest_reconnect_wait: float = 60.0
    """Longest such wait, seconds."""
    buffer_time: float = 10.0
    """Longest time by which work may lag behind live streams, seconds; older frames lose their images."""
    buffer_memory: float = 512.0
    """Largest memory for buffered live images, MiB; older frames lose their images."""
    correction_interval: float = 15.0
    """Time after which live ids are decided again, seconds; 0 for never."""
    correction_memory: float = 90.0
    """Time of the latest frames by which live ids are decided again, seconds."""

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
            "correction_memory",
        ):
            require(getattr(self, name) > 0, self, name, "a number above 0")
        require(self.correction_interval >= 0, self, "correction_interval", "seconds, 0 or more")
