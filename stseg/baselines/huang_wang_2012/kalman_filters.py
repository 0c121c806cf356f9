"""Constant-velocity Kalman filters, many at once (Huang and Wang 2012, section V.E).

The motion model is that of `stseg.tracking.filter.motion_model`.

K = P H^T (H P H^T + R)^-1          correction by a place z with covariance R
x <- x + K (z - H x),  P <- (I - K H) P
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.config import MotionConfig
from stseg.tracking.filter.motion_model import process_noise, transition


class Filters(NamedTuple):
    """Filters of n people."""

    state: Floats
    """float64 (n, 4): x, y, vx, vy in metres and metres per second."""
    covariance: Floats
    """float64 (n, 4, 4): its errors."""

    def __len__(self) -> int:
        return len(self.state)

    def kept(self, which: Flags) -> Filters:
        """Some of them, bool (n,)."""
        return Filters(self.state[which], self.covariance[which])

    def joined_with(self, others: Filters) -> Filters:
        """These, then others, concatenated."""
        return Filters(np.concatenate([self.state, others.state]), np.concatenate([self.covariance, others.covariance]))


def initial(ground: Floats, noise: Floats, pace: float) -> Filters:
    """Filters of births at places (n, 2) with covariances (n, 2, 2), metres.

    `pace`: standard deviation of their velocity, metres per second.
    """
    covariance = np.zeros((len(ground), 4, 4))
    covariance[:, :2, :2] = noise
    covariance[:, 2, 2] = covariance[:, 3, 3] = pace**2
    return Filters(np.concatenate([ground, np.zeros_like(ground)], 1), covariance)


def predicted_filters(filters: Filters, seconds: float, model: MotionConfig) -> Filters:
    """Prediction over some seconds."""
    motion = transition(seconds)
    state, covariance = filters.state @ motion.T, motion @ filters.covariance @ motion.T
    return Filters(state, covariance + process_noise(seconds, model))


def innovations(filters: Filters, ground: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Innovations of places (m, 2) with covariances (m, 2, 2).

    Returns
    -------
    float64 (n, m), float64 (n, m)
        Squared Mahalanobis distance of each place from each filter's prediction, and that plus the logarithm of the
        determinant of the innovation's covariance: twice the negative log-likelihood, up to a constant.
    """
    innovation = filters.covariance[:, None, :2, :2] + noise
    off = ground - filters.state[:, None, :2]
    squares = np.einsum("nmi,nmij,nmj->nm", off, np.linalg.inv(innovation), off)
    return squares, squares + np.log(np.linalg.det(innovation))


def corrected_filters(filters: Filters, which: Ints, ground: Floats, noise: Floats) -> Filters:
    """Filters of which some (k,) are corrected by places (k, 2) with covariances (k, 2, 2), metres."""
    state, covariance = filters.state.copy(), filters.covariance.copy()
    before = covariance[which]
    gain = before[:, :, :2] @ np.linalg.inv(before[:, :2, :2] + noise)
    state[which] += np.einsum("kij,kj->ki", gain, ground - state[which, :2])
    covariance[which] = before - gain @ before[:, :2]
    return Filters(state, covariance)
