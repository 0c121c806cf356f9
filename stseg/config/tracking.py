"""Constants of people and their motion, of segmentation, tracking, and of long and live recordings."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from stseg.arrays import Floats
from stseg.config.ranges import METRES, Settings, at_least, not_negative, positive, require, within

_TALLEST = 2.2
"""Metres; taller pillars reach above most grids."""
_COMMON_HEIGHT, _COMMON_WIDTH = 1.70, 0.42
"""Means of people, metres (HW12)."""


@dataclass(frozen=True)
class SegmentationConfig(Settings):
    """Minimum cut of a window's volume (how-it-works, Energy)."""

    smoothness: float = within(0.4, lambda value: 0 <= value <= 16, "0 to 16 nats")
    """lambda: cost of different labels of two adjacent cells, nats."""
    distance_scale: float = positive(0.20, most=METRES)
    """s: distance of two cells at which that cost has fallen to 0.6, metres."""
    time_distance: float = not_negative(0.15, "0 or more metres", most=METRES)
    """Distance assigned to neighbours in time after motion compensation, metres."""
    neighbours: int = within(8, lambda value: value in (8, 80), "8 or 80")
    """Neighbours of a cell: 8 (one step along x, y, plane or time) or 80 (diagonals as well)."""
    solver: Literal["stseg", "pymaxflow"] = "stseg"
    """Solver of the minimum cuts: their labels are the same, pymaxflow is slower, and taken where numba is disabled."""


@dataclass(frozen=True)
class TrackingConfig(Settings):
    """Windows, and tracks from tracklets (how-it-works, Tracks)."""

    window: float = positive(1.0)
    """Length of a window, seconds; held between 8 and 30 frames. Places are decided one window and
    `context` later."""
    context: float = not_negative(1.0)
    """Time before and after a window that counts, too, when it is decided who is real, seconds; at most 30 frames."""
    height_noise: float = positive(0.035, most=METRES)
    """Error of one frame's height of a fully visible person, metres (standard deviation)."""
    width_noise: float = positive(0.03, most=METRES)
    """Error of one frame's width of a fully visible person, metres (standard deviation)."""
    prediction_horizon: float = not_negative(0.6)
    """Time for which a track is extrapolated while the cells of a window are assigned, seconds."""
    patience: float = not_negative(2.0)
    """Longest time for which a person may go undetected before the track ends, seconds."""
    maximum_gap: float = not_negative(4.0)
    """Longest gap across which two tracklets may be joined by motion and height, seconds."""
    hypotheses: int = within(400, lambda value: 1 <= value <= 100_000, "1 to 100000")
    """Joint hypotheses of all identities that are kept: more are slower, and right more often in crowds."""
    identity_lag: float = positive(60.0)
    """Time after which the identities of the best hypothesis are final, seconds."""
    appearance: Literal["learned", "none"] = "learned"
    """Use of colours and of a detector's features for identities: as much as they tell in the recording, or none; with
    none, nothing of them is stored."""
    return_probability: float = within(1.0, lambda value: 0.5 <= value <= 1, "0.5 to 1")
    """Least probability, by sizes and appearance, at which somebody who comes back takes the id of the earlier visit;
    1 for never: whoever comes is new."""
    interpolation_gap: float = not_negative(1.0)
    """Longest gap that is filled with interpolated positions, seconds."""
    minimum_duration: float = not_negative(0.8)
    """Tracks shorter than this are dropped, seconds (HW12's temporal check)."""
    separation_time: float = not_negative(1.0)
    """Time for which the cells of two people must stay apart to end their encounter, seconds."""


@dataclass(frozen=True)
class SegmentConfig(Settings):
    """Segments: parts of a long recording that are worked on, and written to disk, one by one."""

    length: float = positive(120.0, "seconds, above 0")
    """Length of a segment, seconds; a run that was killed resumes after the last complete one."""
    warm_up: float = not_negative(6.0, "0 or more seconds")
    """Time before its first frame from which a segment observes, seconds, to know who is present."""
    background_period: float = positive(300.0, "seconds, above 0")
    """Without an empty scene, each such part of the recording has its own background, seconds."""
    background_samples: int = at_least(40, 1, 10_000)
    """Frames from which such a background is learned."""


@dataclass(frozen=True)
class LiveConfig(Settings):
    """Recordings that still go on: `stseg run --follow`."""

    file_quiet_time: float = positive(10.0)
    """Time without new data after which the newest file counts as complete, seconds."""
    background_time: float = positive(60.0)
    """Time for which a live camera without an empty scene that fits is observed before the run begins, seconds."""
    frame_tolerance: float = positive(0.3)
    """Largest time difference at which a live image stands for a frame, seconds; at least 3/4 of a frame."""
    stream_timeout: float = positive(5.0)
    """Time without data after which a live stream counts as broken, seconds."""
    reconnect_wait: float = positive(1.0)
    """Wait before a broken stream is opened again, seconds; doubled after every failure."""
    longest_reconnect_wait: float = positive(60.0)
    """Longest such wait, seconds."""
    buffer_time: float = positive(10.0)
    """Longest time by which work may lag behind live streams, seconds; older frames lose their images."""
    buffer_memory: float = positive(512.0)
    """Largest memory for buffered live images, MiB; older frames lose their images."""
    correction_interval: float = not_negative(15.0, "seconds, 0 or more")
    """Time after which live ids are decided again, seconds; 0 for never."""
    correction_memory: float = positive(90.0)
    """Time of the latest frames by which live ids are decided again, seconds."""


@dataclass(frozen=True)
class BodyConfig(Settings):
    """Population prior of body height and width. A person is a pillar: a body of revolution of that size.

    Widths of bodies do not go with their heights, but for small ones: below one spread under the mean height, mean
    widths fall in proportion.
    """

    height_mean: float = positive(_COMMON_HEIGHT, most=_TALLEST)
    """Mean height of the people recorded, metres (HW12); the first guess of what the run learns."""
    height_spread: float = positive(0.12, most=METRES)
    """Standard deviation of their heights, metres; the least that the run learns."""
    width_mean: float = positive(_COMMON_WIDTH, most=_TALLEST)
    """Mean width of a body across shoulders and arms, metres; the first guess."""
    width_spread: float = positive(0.04, most=METRES)
    """Standard deviation of these widths, metres; the least that the run learns."""
    prior_weight: float = positive(20.0)
    """Weight of these means and spreads: seconds of one person; sizes that the run measures count beside them."""
    heights: tuple[float, ...] = (1.0, 1.25, 1.5, 1.6, 1.7, 1.8, 1.9)
    """Heights that the search for candidates tries, metres, rising."""

    @property
    def breadth(self) -> float:
        """Ratio of the mean width to that of people."""
        return self.width_mean / _COMMON_WIDTH

    @property
    def stoutness(self) -> float:
        """Ratio of width by height to that of people, at least 1: greater for animals."""
        return max(self.breadth * _COMMON_HEIGHT / self.height_mean, 1.0)

    def width_of(self, height: Floats) -> Floats:
        """Mean width of bodies of given heights, both metres: that of all, less in proportion for small ones."""
        small = self.height_mean - self.height_spread
        return self.width_mean * np.minimum(height / small, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.height_mean > 2 * self.height_spread, self, "height_mean", "more than two standard deviations")
        require(self.width_mean > 2 * self.width_spread, self, "width_mean", "more than two standard deviations")
        require(len(self.heights) > 0 and min(self.heights) > 0, self, "heights", "one or more heights above 0 m")
        in_order = list(self.heights) == sorted(self.heights) and max(self.heights) <= _TALLEST
        require(in_order, self, "heights", f"rising, at most {_TALLEST} m")


@dataclass(frozen=True)
class MotionConfig(Settings):
    """Nearly constant velocity: white acceleration (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2)."""

    speed_spread: float = positive(0.8, most=METRES)
    """Standard deviation of walking velocity along each axis, metres per second."""
    velocity_noise: float = positive(0.8, most=METRES)
    """Random change of velocity, metres per second per square root of a second (standard deviation)."""
    position_noise: float = positive(0.15, most=METRES)
    """Error of one frame's position beyond its own covariance, metres (standard deviation): calibration and gait."""
