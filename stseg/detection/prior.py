"""The prior of one frame: predicted tracks, the cost of a birth, and the heights of people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.config import BodyConfig, DetectionConfig
from stseg.records.border import Border
from stseg.records.candidates import Candidates
from stseg.records.predicted_tracks import PredictedTracks, no_tracks
from stseg.records.sizes import Sizes, log_heavy_tailed, log_population_height


@dataclass(frozen=True)
class Prior:
    """One frame's prior."""

    predicted: PredictedTracks
    """Tracks of earlier frames, predicted to this one."""
    config: DetectionConfig
    """The detector's constants."""
    body: BodyConfig
    """Population prior of heights and widths."""
    border: Border
    """Where people may enter."""
    cost: float
    """Cost of a birth far from the border, nats."""

    @classmethod
    def of(cls, predicted: PredictedTracks | None, config: DetectionConfig, body: BodyConfig, border: Border) -> Prior:
        """The prior of a frame; None for a first frame: no track is predicted, and births cost nothing."""
        if predicted is None:
            return cls(no_tracks(), config, body, border, 0.0)
        return cls(predicted, config, body, border, config.birth_cost)

    def pool(self) -> Candidates:
        """Predicted tracks inside the border, as candidates; tracks that leave the area are not followed further."""
        inside, sizes = self.border.away(self.predicted.ground) > 0, self.predicted.sizes
        return Candidates(self.predicted.ground[inside], sizes.height[inside], sizes.width[inside])

    def expected(self, track_index: Ints) -> Candidates:
        """Some of the predicted tracks, int64 (n,), as candidates."""
        sizes = self.predicted.sizes.at(track_index)
        return Candidates(self.predicted.ground[track_index], sizes.height, sizes.width)

    def log_height(self, heights: Floats) -> Floats:
        """Log prior density of heights, metres, beside that of the mean height: nats, float64 (n,)."""
        return log_population_height(heights, self.body)

    def log_size(self, heights: Floats, widths: Floats) -> Floats:
        """Log prior density of heights and widths, metres, beside that of the means: nats, float64 (n,)."""
        wide = log_heavy_tailed((widths - self.body.width_of(heights)) / self.body.width_spread)
        return self.log_height(heights) + wide

    def track_sizes(self, sizes: Sizes, track_index: Ints) -> Sizes:
        """Size posteriors of one frame under the population prior, put under each track's own prior instead.

        `track_index` int64 (n,) is the predicted track of each person, -1 for births.
        """
        before = Sizes.of_population(len(track_index), self.body)
        measured, tracked = sizes.as_measurements(before), np.flatnonzero(track_index >= 0)
        before.put(tracked, self.predicted.sizes.at(track_index[tracked]))
        return measured.with_prior(before)

    def birth_cost(self, ground: Floats) -> Floats:
        """Cost of a birth at ground points (n, 2), nats, float64 (n,)."""
        return self.cost * self.border.inside(ground, self.config.border_width)

    def track_log_ratio(self, pool: Candidates) -> Floats:
        """Log-ratio of each candidate being each predicted track against being a birth, nats, float64 (n, track)."""
        return self.predicted.track_log_ratio(pool.ground, pool.height, self.body, self.config.prior_log_odds)
