"""Zones and lines on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats
from stseg.geometry.grid import inside_polygon


@dataclass(frozen=True)
class Zone:
    """A named area: polygons on the ground, metres, each float64 (k, 2); holes are polygons within polygons."""

    name: str
    rings: tuple[Floats, ...]

    def contains(self, ground: Floats) -> Flags:
        """Whether each ground point (n, 2) is inside, bool (n,): even-odd rule over all rings."""
        inside = np.zeros(len(ground), bool)
        for ring in self.rings:
            inside ^= inside_polygon(ground, ring)
        return inside

    @property
    def area(self) -> float:
        """Square metres; a ring inside another one is a hole."""
        total = 0.0
        for k, ring in enumerate(self.rings):
            x, y = ring.T
            size = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
            others = Zone("", self.rings[:k] + self.rings[k + 1 :])
            total += -size if others.contains(ring[:1]).any() else size
        return total


@dataclass(frozen=True)
class Line:
    """A named line on the ground, float64 (k, 2), metres. `left` and `right` are as seen along it."""

    name: str
    points: Floats

    def distance(self, ground: Floats) -> Floats:
        """Distance of each ground point (n, 2) from the line, metres, float64 (n,)."""
        start, way = self.points[:-1], np.diff(self.points, axis=0)
        length = np.maximum((way**2).sum(axis=1), 1e-12)
        along = np.clip(((ground[:, None] - start) * way).sum(axis=2) / length, 0, 1)
        return np.asarray(np.linalg.norm(ground[:, None] - start - along[..., None] * way, axis=2).min(axis=1))


@dataclass(frozen=True)
class Areas:
    """Zones and lines to measure in."""

    zones: tuple[Zone, ...] = ()
    lines: tuple[Line, ...] = ()
