"""Scripted routes of pedestrians, for scenes with encounters at known times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.errors import ConfigError

_SMOOTHING = 0.6
"""Seconds over which a change of velocity is spread."""


@dataclass(frozen=True, slots=True)
class Route:
    """A pedestrian's route: straight lines between timed stops; two stops at one place are a pause.

    Attributes
    ----------
    height
        Body height, metres.
    stops
        Seconds from the first frame, x and y in metres; the person is there from the first stop's time to the last's.

    Raises
    ------
    ConfigError
        Where there are fewer than two stops, or their times do not rise.
    """

    height: float
    stops: tuple[tuple[float, float, float], ...]

    def __post_init__(self) -> None:
        times = [stop[0] for stop in self.stops]
        if len(times) < 2 or any(np.diff(times) <= 0):
            raise ConfigError("route", "stops", times, "two or more stops at rising times")

    def is_there(self, time: float) -> bool:
        """Whether the person is in the scene at a time, seconds."""
        return self.stops[0][0] <= time <= self.stops[-1][0]

    def ground(self, time: float) -> Floats:
        """Ground position, metres, float64 (2,): the polyline smoothed over the duration of a turn."""
        times, x, y = np.array(self.stops).T
        around = np.clip(time + _SMOOTHING * np.linspace(-0.5, 0.5, 13), times[0], times[-1])
        return np.array([np.interp(around, times, x).mean(), np.interp(around, times, y).mean()])
