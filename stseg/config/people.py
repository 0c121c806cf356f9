"""Sizes and motion of people: one body model and one motion model for all stages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.config.ranges import Settings, positive, require

_TALLEST = 2.2
"""Metres; taller pillars reach above most grids."""


@dataclass(frozen=True)
class BodyConfig(Settings):
    """Population prior of body height and width. A person is a pillar: a body of revolution of that size.

    Widths of bodies do not go with their heights, but for small ones: below one spread under the mean height, mean
    widths fall in proportion.
    """

    height_mean: float = positive(1.70)
    """Mean height of the people recorded, metres (HW12); the first guess of what the run learns."""
    height_spread: float = positive(0.12)
    """Standard deviation of their heights, metres; the least that the run learns."""
    width_mean: float = positive(0.42)
    """Mean width of a body across shoulders and arms, metres; the first guess."""
    width_spread: float = positive(0.04)
    """Standard deviation of these widths, metres; the least that the run learns."""
    prior_weight: float = positive(20.0)
    """Weight of these means and spreads: seconds of one person; sizes that the run measures count beside them."""
    heights: tuple[float, ...] = (1.0, 1.25, 1.5, 1.6, 1.7, 1.8, 1.9)
    """Heights that the search for candidates tries, metres, rising."""
    box_heights: tuple[float, ...] = (1.5, 1.6, 1.7, 1.8, 1.9)
    """The same for boxes, fewer: the box of a half-occluded adult looks like that of a child at another position."""

    def width_of(self, height: Floats) -> Floats:
        """Mean width of bodies of given heights, both metres: that of all, less in proportion for small ones."""
        small = self.height_mean - self.height_spread
        return self.width_mean * np.minimum(height / small, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.height_mean > 2 * self.height_spread, self, "height_mean", "more than two standard deviations")
        require(self.width_mean > 2 * self.width_spread, self, "width_mean", "more than two standard deviations")
        for name in ("heights", "box_heights"):
            heights = getattr(self, name)
            require(len(heights) > 0 and min(heights) > 0, self, name, "one or more heights above 0 m")
            in_order = list(heights) == sorted(heights) and max(heights) <= _TALLEST
            require(in_order, self, name, f"rising, at most {_TALLEST} m")


@dataclass(frozen=True)
class MotionConfig(Settings):
    """Nearly constant velocity: white acceleration (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2)."""

    speed_spread: float = positive(0.8)
    """Standard deviation of walking velocity along each axis, metres per second."""
    velocity_noise: float = positive(0.8)
    """Random change of velocity, metres per second per square root of a second (standard deviation)."""
    position_noise: float = positive(0.15)
    """Error of one frame's position beyond its own covariance, metres (standard deviation): calibration and gait."""
