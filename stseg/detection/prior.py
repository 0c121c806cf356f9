"""What is known of a frame before any view is asked: who is expected, what a newcomer costs, how tall people are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import BodyConfig, DetectionConfig
from stseg.model.border import Border
from stseg.model.candidates import Candidates
from stseg.model.predicted_tracks import PredictedTracks, no_tracks
from stseg.model.sizes import Sizes


@dataclass(frozen=True)
class Prior:
    """One frame's prior.

    Attributes
    ----------
    expected
        Whom the frames before lead to expect.
    config
        The pass's constants.
    body
        Population prior of heights and widths.
    border
        Where people may come in.
    cost
        What a newcomer far from the border costs, nats.
    """

    expected: PredictedTracks
    config: DetectionConfig
    body: BodyConfig
    border: Border
    cost: float

    @classmethod
    def of(cls, expected: PredictedTracks | None, config: DetectionConfig, body: BodyConfig, border: Border) -> Prior:
        """The prior of a frame; None expects nobody and takes nobody for a newcomer, as a first frame must."""
        if expected is None:
            return cls(no_tracks(), config, body, border, 0.0)
        return cls(expected, config, body, border, config.birth_cost)

    def pool(self) -> Candidates:
        """Those expected inside the border, as candidates: who leaves the area is not followed out of it."""
        inside, sizes = self.border.away(self.expected.ground) > 0, self.expected.sizes
        return Candidates(self.expected.ground[inside], sizes.height[inside], sizes.width[inside])

    def tall(self, heights: Floats) -> Floats:
        """What speaks for somebody as tall as this, metres, beyond somebody of mean height: nats, float64 (n,)."""
        return -0.5 * ((heights - self.body.height_mean) / self.body.height_spread) ** 2

    def known_sizes(self, sizes: Sizes, walker: Ints) -> Sizes:
        """Sizes that a frame found as if of anybody, of those who are known by all that was seen of them before.

        `walker` int64 (n,) says whom of those expected each is, -1 for newcomers.
        """
        before = Sizes.of_population(len(walker), self.body)
        measured, met = sizes.as_measurements(before), np.flatnonzero(walker >= 0)
        before.put(met, self.expected.sizes.at(walker[met]))
        return measured.with_prior(before)

    def newcomer(self, ground: Floats) -> Floats:
        """What a newcomer costs at ground points (n, 2), nats, float64 (n,)."""
        return self.cost * self.border.inside(ground, self.config.border_width)

    def track_log_ratio(self, pool: Candidates) -> Floats:
        """What speaks for each candidate by being each walker, nats, float64 (n, walker)."""
        return self.expected.track_log_ratio(pool.ground, pool.height, self.body, self.config.prior_log_odds)
