"""Sudden changes of illumination: a switched lamp, a cloud, automatic exposure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Singles
from stseg.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Lamp:
    """A change of the illumination.

    Raises
    ------
    ConfigError
        Where a value is out of its range.
    """

    brightness: float
    """Added light at its place, relative to the room's own; negative to remove light."""
    on: float
    off: float = math.inf
    """Start and end, seconds from the first frame."""
    rise: float = 0.0
    """Duration of start and end, seconds; 0 for a switch."""
    place: tuple[float, float, float] = (0.0, 0.0, 2.5)
    """x, y, z in metres."""
    reach: float = math.inf
    """Distance of half its light, metres; infinite for a uniform change: a cloud, an exposure."""

    def __post_init__(self) -> None:
        if not self.brightness > -1:
            raise ConfigError("lamp", "brightness", self.brightness, "more than -1, that is no light at all")
        if not self.off >= self.on:
            raise ConfigError("lamp", "off", self.off, "a time after it is switched on")
        if not self.rise >= 0:
            raise ConfigError("lamp", "rise", self.rise, "seconds, 0 or more")
        if not self.reach > 0:
            raise ConfigError("lamp", "reach", self.reach, "metres, above 0")

    def power(self, seconds: float) -> float:
        """Share of its light at a time, 0..1."""
        return self._risen(seconds - self.on) - self._risen(seconds - self.off)

    def _risen(self, since: float) -> float:
        if self.rise == 0:
            return float(since >= 0)
        return min(max(since / self.rise, 0.0), 1.0)


def lit(lamps: Sequence[Lamp], seconds: float, points: Floats) -> Singles:
    """The light at points, relative to the room without lamps (inverse square law, softened beside the lamp).

    Parameters
    ----------
    lamps
        Those of the scene.
    seconds
        Since the first frame.
    points : float64 (..., 3)
        Metres.

    Returns
    -------
    float32 (...)
        0 or more.
    """
    light = np.ones(points.shape[:-1])
    for lamp in lamps:
        power = lamp.power(seconds)
        if power > 0:
            away = ((points - np.array(lamp.place)) ** 2).sum(axis=-1) / lamp.reach**2
            light += power * lamp.brightness / (1.0 + away)
    return np.maximum(light, 0.0).astype(np.float32)
