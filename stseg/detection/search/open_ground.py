"""The ground that a search may decide otherwise: all of it, or what lies about places where something is open."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.detection.search.map_estimate import MapEstimate


@dataclass(frozen=True)
class OpenGround:
    """Ground about some places, or all of it."""

    places: Floats | None = None
    """float64 (k, 2): metres; None for all of the ground."""
    reach: float = 1.0
    """Distance of such a place up to which people may be found otherwise than they were, metres."""

    @property
    def is_empty(self) -> bool:
        """Whether there is no such ground."""
        return self.places is not None and not len(self.places)

    def joined_with(self, places: Floats) -> OpenGround:
        """This ground and that about more places (n, 2), metres."""
        return self if self.places is None else replace(self, places=np.concatenate([self.places, places]))

    def covers(self, ground: Floats) -> Flags:
        """Whether each point (n, 2) lies on it."""
        is_covered = np.full(len(ground), self.places is None)
        for place in () if self.places is None else self.places:  # all pairs of a large lattice would fill the memory
            offset = np.abs(ground - place)
            rows = np.flatnonzero((offset[:, 0] < self.reach) & (offset[:, 1] < self.reach))
            is_covered[rows] |= np.hypot(*offset[rows].T) < self.reach
        return is_covered

    def members_of(self, estimate: MapEstimate) -> Ints:
        """Members of an estimate that stand on it, int64 (k,), counted from 0."""
        return np.flatnonzero(self.covers(estimate.pool.ground[estimate.members]))


EVERYWHERE = OpenGround()
"""All of the ground."""
