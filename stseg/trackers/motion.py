"""Kalman filters of people who walk at constant velocity but for a white acceleration, many side by side.

x' = F x,  P' = F P F^T + Q           carried over some seconds
K = P' H^T (H P' H^T + R)^-1          corrected by a place z with covariance R
x = x' + K (z - H x'),  P = (I - K H) P'
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints


class Filters(NamedTuple):
    """Filters of n people.

    Attributes
    ----------
    state : float64 (n, 4)
        x, y, vx, vy in metres and metres per second.
    covariance : float64 (n, 4, 4)
    """

    state: Floats
    covariance: Floats

    def __len__(self) -> int:
        return len(self.state)

    def kept(self, which: Flags) -> Filters:
        """Some of them, bool (n,)."""
        return Filters(self.state[which], self.covariance[which])

    def joined_with(self, others: Filters) -> Filters:
        """These, then others."""
        return Filters(np.concatenate([self.state, others.state]), np.concatenate([self.covariance, others.covariance]))


def begun(ground: Floats, noise: Floats, pace: float) -> Filters:
    """Filters of people seen for the first time at places (n, 2) with covariances (n, 2, 2), metres.

    Their velocity is anything with a standard deviation of `pace`, metres per second.
    """
    covariance = np.zeros((len(ground), 4, 4))
    covariance[:, :2, :2] = noise
    covariance[:, 2, 2] = covariance[:, 3, 3] = pace**2
    return Filters(np.concatenate([ground, np.zeros_like(ground)], 1), covariance)


def carried(filters: Filters, seconds: float, turn: float) -> Filters:
    """Some time later; `turn` is how the velocity changes, metres per second per square root of a second."""
    motion = np.eye(4)
    motion[:2, 2:] = seconds * np.eye(2)
    drift = np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]]) * turn**2
    state, covariance = filters.state @ motion.T, motion @ filters.covariance @ motion.T
    return Filters(state, covariance + np.kron(drift, np.eye(2)))


def surprise(filters: Filters, ground: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """How places (m, 2) with covariances (m, 2, 2) suit filters.

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


def corrected(filters: Filters, which: Ints, ground: Floats, noise: Floats) -> Filters:
    """Filters of which some (k,) were seen at places (k, 2) with covariances (k, 2, 2), metres."""
    state, covariance = filters.state.copy(), filters.covariance.copy()
    before = covariance[which]
    gain = before[:, :, :2] @ np.linalg.inv(before[:, :2, :2] + noise)
    state[which] += np.einsum("kij,kj->ki", gain, ground - state[which, :2])
    covariance[which] = before - gain @ before[:, :2]
    return Filters(state, covariance)
