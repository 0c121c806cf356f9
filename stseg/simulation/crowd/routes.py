"""Scripted routes of pedestrians, for scenes with encounters at known times."""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.errors import ConfigError

_SMOOTHING = 0.6
"""Seconds over which a change of velocity is spread."""


@dataclass(frozen=True, slots=True)
class Route:
    """A pedestrian's route: straight lines between timed stops; two stops at one place are a pause.

    Raises
    ------
    ConfigError
        Where there are fewer than two stops, or their times do not rise.
    """

    height: float
    """Body height, metres."""
    stops: tuple[tuple[float, float, float], ...]
    """Seconds from the first frame, x and y in metres; the person is there from the first stop's time to the last's."""

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


CROSSING = (
    # Head on, 0.40 m from axis to axis, at 4 s.
    Route(1.72, ((0.0, -2.8, -0.8), (8.0, 2.8, -0.8))),
    Route(1.72, ((0.0, 2.8, -0.4), (8.0, -2.8, -0.4))),
    # At right angles, 0.42 m from axis to axis, at 3.3 s.
    Route(1.78, ((0.0, -2.8, 1.4), (6.0, 2.8, 1.4))),
    Route(1.66, ((0.75, 0.6, 3.5), (4.0, 0.6, 0.467), (7.0, 3.3, 0.2))),
    # A standing person is passed at 0.45 m by another at 9 s, and by a third from the other side at 11 s.
    Route(1.70, ((6.0, -0.2, 3.3), (8.0, 0.0, 1.0), (12.0, 0.0, 1.0), (14.0, 0.2, 3.3))),
    Route(1.74, ((6.5, -2.8, 0.55), (11.5, 2.8, 0.55))),
    Route(1.69, ((8.5, 2.8, 1.45), (13.5, -2.8, 1.45))),
)
"""Pedestrians cross at less than half a metre; 14 seconds."""


def meeting(heights: tuple[float, float]) -> tuple[Route, ...]:
    """Two pedestrians walk 0.5 m apart, stand together for ten seconds from 3.3 s on, and part: 16 seconds."""
    one, other = heights
    return (
        Route(one, ((0.0, -2.8, 0.25), (3.0, -0.2, 0.25), (13.6, -0.2, 0.25), (16.0, 1.8, 2.2))),
        Route(other, ((0.0, -2.8, -0.25), (3.0, -0.2, -0.25), (13.6, -0.2, -0.25), (16.0, 1.8, -2.2))),
    )


BORDER = (
    # Head on, 0.43 m from axis to axis, at 3.3 s; the second enters the area at 0.85 s and leaves it at 5.6 s.
    Route(1.72, ((0.0, -2.3, 0.9), (3.3, 0.0, 0.9), (6.5, 1.8, -0.2), (14.0, 1.9, -1.9))),
    Route(1.72, ((0.0, 3.367, 1.3), (3.3, 0.0, 1.3), (5.6, -2.5, 1.3), (6.3, -3.3, 1.3))),
    # Enters at 4.05 s and meets the fourth, 0.5 m away, from 7.3 to 10.5 s; they part and leave at 12.85 s.
    Route(
        1.76,
        (
            (3.3, -0.7, -3.3),
            (4.05, -0.7, -2.5),
            (7.3, -0.7, -0.6),
            (10.5, -0.7, -0.6),
            (12.85, -2.5, -0.6),
            (13.6, -3.3, -0.6),
        ),
    ),
    Route(
        1.68,
        (
            (0.0, 0.9, -2.2),
            (2.0, 0.9, -1.6),
            (7.3, -0.2, -0.6),
            (10.5, -0.2, -0.6),
            (12.85, -0.2, 2.5),
            (13.6, -0.2, 3.3),
        ),
    ),
    # Enters at 8.85 s, where the second left.
    Route(1.71, ((8.1, -3.3, 1.3), (8.85, -2.5, 1.3), (11.3, 0.3, 1.9), (14.0, 1.9, 1.9))),
)
"""Encounters, entries and exits at the ends (frames 8 k + 1) and overlaps of windows of ten frames; 14 seconds."""
