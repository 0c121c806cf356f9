"""State of one track: place, velocity and lasting stray by a constant-velocity Kalman filter, sizes, and existence."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Floats
from stseg.config import MotionConfig
from stseg.noise.lasting_error import PLACE_ERROR
from stseg.tracking.filter.motion_model import augmented_noise, augmented_transition

_SIZE_DRIFT = 0.002
"""Random walk of a person's apparent height and width, metres per square root of a second: shoes, stoop, lens."""


class Measurement(NamedTuple):
    """A scalar measurement and its variance, metres and square metres."""

    mean: float
    variance: float


class PlacePosterior(NamedTuple):
    """Posterior of a body's place, float64 (2,), (2, 2), metres, and the prior that is in it."""

    ground: Floats
    covariance: Floats
    prior: BodyPlace


class BodyPlace(NamedTuple):
    """A body's place by a track's state: `matrix` float64 (2, 6) times the state, and white noise, square metres.

    Where detectors put a body strays from the track, and most of that lasts: pose, gait and the views that see it.
    """

    matrix: Floats
    white: float

    @classmethod
    def of(cls, noise: float) -> BodyPlace:
        """The place of bodies that stray by a standard deviation, metres."""
        lasting = noise * np.sqrt(PLACE_ERROR.lasting) * np.eye(2)
        matrix = np.concatenate([np.eye(2), np.zeros((2, 2)), lasting], axis=1)
        return cls(matrix, float(PLACE_ERROR.white) * noise**2)

    def ground(self, state: Floats) -> Floats:
        """The place by a state, float64 (2,), metres."""
        return np.asarray(self.matrix @ state)

    def covariance(self, covariance: Floats) -> Floats:
        """Its covariance by that of a state, float64 (2, 2), square metres."""
        return np.asarray(self.matrix @ covariance @ self.matrix.T + self.white * np.eye(2))


class TrackState(NamedTuple):
    """State of one track at its last detection."""

    track: int
    """Number, from 1; 0 for a tentative track: a candidate that was rejected, but may be confirmed later."""
    first_seen: int
    last_seen: int
    """Frames of the first and the last detection."""
    state: Floats
    covariance: Floats
    """float64 (6,) and (6, 6): x, y, vx, vy in metres and metres per second, and the lasting part of the body's
    stray, in its own standard deviations (`stseg.tracking.filter.motion_model`)."""
    height: float
    height_variance: float
    width: float
    width_variance: float
    """Body height and width, metres, and their variances, square metres."""
    log_odds: float
    """Log-odds of existence, nats."""

    def predicted(self, seconds: float, model: MotionConfig) -> TrackState:
        """The state some seconds after the last detection."""
        motion = augmented_transition(seconds)
        return self._replace(
            state=motion @ self.state,
            covariance=motion @ self.covariance @ motion.T + augmented_noise(seconds, model),
            height_variance=self.height_variance + _SIZE_DRIFT**2 * seconds,
            width_variance=self.width_variance + _SIZE_DRIFT**2 * seconds,
        )

    def corrected(self, frame: int, place: PlacePosterior, height: Measurement, width: Measurement) -> TrackState:
        """The predicted state after a detection.

        The body's place is b = H s + noise of the state s, and the detector gives the posterior of b under the prior of
        this prediction. Given b the measurement says nothing more, so mean and covariance of the state follow from
        those of b by its regression on b (Bar-Shalom, Li and Kirubarajan 2001, section 1.4.14).

        Parameters
        ----------
        frame
            Of the detection.
        place
            The posterior of the body's place.
        height, width
            Measurements, without this prediction as their prior.
        """
        prior = place.prior.covariance(self.covariance)
        gain = self.covariance @ place.prior.matrix.T @ np.linalg.inv(prior)
        surplus = prior - place.covariance
        return self.resized(height, width)._replace(
            last_seen=frame,
            state=self.state + gain @ (place.ground - place.prior.ground(self.state)),
            covariance=self.covariance - gain @ surplus @ gain.T,
        )

    def resized(self, height: Measurement, width: Measurement) -> TrackState:
        """The state after measurements of its sizes."""
        tall = self.height_variance / (self.height_variance + height.variance)
        wide = self.width_variance / (self.width_variance + width.variance)
        return self._replace(
            height=self.height + tall * (height.mean - self.height),
            height_variance=self.height_variance * (1 - tall),
            width=self.width + wide * (width.mean - self.width),
            width_variance=self.width_variance * (1 - wide),
        )
