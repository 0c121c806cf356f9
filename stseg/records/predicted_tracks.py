"""Predicted tracks of a frame, and the log-ratio of a candidate being one (the prior of HW12 eq. 21, per person).

A track k of earlier frames exists with log-odds o_k, at N(x_k, C_k), with a height of N(h_k, v_k). A birth exists with
log-odds `person` at any place of the resolution a, with the population's height. The log-ratio of candidate j being
track k against being a birth is

    known_jk = o_k - person + log(a_k / sqrt|C_k|) - d_jk^2 / 2 + log N(h_j; h_k, v_k) - log N(h_j; mean, spread^2)

with d_jk the Mahalanobis distance of the places. The resolution a_k is s^2, or the area to which the last detection
placed the track where that is larger: with few views many places near each other explain the same. Each track is
assigned to one candidate at most.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Ints
from stseg.config import BodyConfig
from stseg.records.sizes import Sizes, log_population_height

PLACE_RESOLUTION = 0.1
"""s: resolution of places in one frame, metres (standard deviation)."""
LEAST_HEIGHT_RATIO = -4.0
"""Least log-ratio of a height, nats: people stoop and sit."""
EXISTENCE_DECAY = 4.0
"""Decay rate of the existence log-odds while a person is undetected, nats per second."""


@dataclass(frozen=True)
class PredictedTracks:
    """Tracks of earlier frames, predicted to this frame."""

    ground: Floats
    """float64 (n, 2): metres."""
    covariance: Floats
    """float64 (n, 2, 2): square metres; measurement noise of this frame included."""
    sizes: Sizes
    """Heights and widths; measurement noise of this frame included in their variances."""
    existence: Floats
    """float64 (n,): log-odds that the track still exists, nats."""
    resolution: Floats | float = PLACE_RESOLUTION**2
    """float64 (n,), or one for all: a_k, square metres."""

    def __len__(self) -> int:
        return len(self.ground)

    @cached_property
    def _precision(self) -> NDArray[np.floating[Any]]:
        return np.linalg.inv(self.covariance)

    @cached_property
    def _concentration(self) -> Floats:
        """Log-ratio of the density at each track's place against that of a birth within the resolution, nats."""
        return np.asarray(np.log(self.resolution / np.sqrt(np.linalg.det(self.covariance))))

    def track_log_ratio(self, ground: Floats, height: Floats, body: BodyConfig, birth_log_odds: float) -> Floats:
        """Log-ratio of candidates (n, 2), (n,) being tracks against being births, nats, float64 (n, track)."""
        if not len(self):
            return np.zeros((len(ground), 0))
        variance = self.sizes.height_variance
        off = height[:, None] - self.sizes.height
        tall = -0.5 * off**2 / variance + np.log(body.height_spread / np.sqrt(variance))
        population = log_population_height(height, body)
        squares = _squares(ground[:, None] - self.ground, self._precision)
        shape = np.maximum(tall - population[:, None], LEAST_HEIGHT_RATIO)
        return np.asarray(self.existence - birth_log_odds + self._concentration - 0.5 * squares + shape)

    def place_log_density(self, track: Ints, ground: Floats) -> Floats:
        """Log-densities of some tracks' places (n,) at points of each (n, point, 2), up to constants, nats."""
        off = ground - self.ground[track, None]
        return -0.5 * _squares(off, self._precision[track][:, None])


def _squares(off: Floats, precision: NDArray[np.floating[Any]]) -> Floats:
    """Squared Mahalanobis distances of points that are off (..., 2) by precisions (..., 2, 2), float64 (...)."""
    x, y = off[..., 0], off[..., 1]
    both = precision[..., 0, 1] + precision[..., 1, 0]
    return np.asarray(precision[..., 0, 0] * x * x + both * x * y + precision[..., 1, 1] * y * y)


def no_tracks() -> PredictedTracks:
    """No track."""
    none = np.zeros(0)
    return PredictedTracks(np.zeros((0, 2)), np.zeros((0, 2, 2)), Sizes(none, none, none, none), none)


@dataclass(frozen=True)
class PredictedPlaces:
    """Predicted places of tracks in the frames of a window."""

    track: Ints
    """int64 (k,): track numbers, 1 or more, rising."""
    expected: Flags
    """bool (time, k): whether the track has a prediction in the frame."""
    ground: Floats
    """float64 (time, k, 2): metres."""
    covariance: Floats
    """float64 (time, k, 2, 2): square metres."""
    height: Floats
    """float64 (time, k): of their heads, metres."""
