"""Whom a frame expects, from the frames before: the prior of HW12 eq. 21 person by person (METHODS 7).

A walker k of earlier frames is there with log-odds o_k, at N(x_k, C_k), as tall as N(h_k, v_k). A newcomer is there
with log-odds `person` at any place of the resolution s, as tall as anybody. So what speaks for candidate j by being
walker k, beyond what speaks for a newcomer, is

    known_jk = o_k - person + log(s^2 / sqrt|C_k|) - d_jk^2 / 2 + log N(h_j; h_k, v_k) - log N(h_j; mean, spread^2)

with d_jk the Mahalanobis distance of the places. Each walker speaks for one candidate at most.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Floats, Ints
from stseg.config import BodyConfig
from stseg.model.sizes import Sizes

_RESOLUTION = 0.1
"""s: how finely one frame tells places apart, metres (standard deviation)."""
_OUT_OF_SHAPE = -4.0
"""A wrong height speaks no more strongly than this against a walker, nats: people stoop and sit."""


@dataclass(frozen=True)
class PredictedTracks:
    """Walkers of earlier frames, carried to the frame.

    Attributes
    ----------
    ground : float64 (n, 2), covariance : float64 (n, 2, 2)
        Metres, square metres; how far the frame's own place may be off is in it.
    sizes
        Heights and widths, how far the frame's own measurement may be off is in their variances.
    existence : float64 (n,)
        Log-odds that the walker is still there, nats.
    """

    ground: Floats
    covariance: Floats
    sizes: Sizes
    existence: Floats

    def __len__(self) -> int:
        return len(self.ground)

    def track_log_ratio(self, ground: Floats, height: Floats, body: BodyConfig, birth_log_odds: float) -> Floats:
        """What speaks for candidates (n, 2), (n,) by being walkers, nats, float64 (n, walker)."""
        if not len(self):
            return np.zeros((len(ground), 0))
        sharp = np.log(_RESOLUTION**2 / np.sqrt(np.linalg.det(self.covariance)))
        variance = self.sizes.height_variance
        off = height[:, None] - self.sizes.height
        tall = -0.5 * off**2 / variance + np.log(body.height_spread / np.sqrt(variance))
        anybody = -0.5 * ((height - body.height_mean) / body.height_spread) ** 2
        squares = _squares(ground[:, None] - self.ground, np.linalg.inv(self.covariance))
        shape = np.maximum(tall - anybody[:, None], _OUT_OF_SHAPE)
        return np.asarray(self.existence - birth_log_odds + sharp - 0.5 * squares + shape)

    def place_log_density(self, walker: Ints, ground: Floats) -> Floats:
        """Log-densities of some walkers' places (n,) at points of each (n, point, 2), up to constants, nats."""
        off = ground - self.ground[walker, None]
        return -0.5 * _squares(off, np.linalg.inv(self.covariance[walker])[:, None])


def _squares(off: Floats, precision: NDArray[np.floating[Any]]) -> Floats:
    """Squared Mahalanobis distances of points that are off (..., 2) by precisions (..., 2, 2), float64 (...)."""
    x, y = off[..., 0], off[..., 1]
    both = precision[..., 0, 1] + precision[..., 1, 0]
    return np.asarray(precision[..., 0, 0] * x * x + both * x * y + precision[..., 1, 1] * y * y)


def no_tracks() -> PredictedTracks:
    """Nobody was there before."""
    none = np.zeros(0)
    return PredictedTracks(np.zeros((0, 2)), np.zeros((0, 2, 2)), Sizes(none, none, none, none), none)
