"""The potential between the ground and a view (Du and Piater 2006, equation 12), and messages through it (5, 6, 8, 9).

With ground particles g_n, a view's particles x_m, their places H^-1 x_m on the ground and covariances
Gamma_m = s^2 J_m J_m^T, J_m the Jacobian of H^-1 at x_m,

    psi_nm = (1 - lambda) N(g_n; H^-1 x_m, Gamma_m) + lambda N(g_n; mu, Lambda)

A view's weights a_m are the probabilities that it sees the target at x_m; the remainder to 1 is the probability that it
does not see the target at all. That part of the message is flat. So a view that sees nothing sends a flat message.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.kernels.accelerate import kernel


@dataclass(frozen=True)
class Outlier:
    """The outlier term of eq. 12: the target is not where the view's belief is."""

    share: float
    """lambda."""
    mean: Floats
    """float64 (2,): mu, metres."""
    spread: float
    """Standard deviation along both axes, metres: Lambda is its square times the unit matrix."""

    @property
    def flat(self) -> float:
        """Density of an uninformative message, 1/square metre: the outlier term's at its mean."""
        return float(0.5 / np.pi / self.spread**2)

    def density(self, ground: Floats) -> Floats:
        """At ground points (n, 2), 1/square metre, float64 (n,)."""
        square = ((ground - self.mean) ** 2).sum(1) / self.spread**2
        return np.asarray(self.flat * np.exp(-0.5 * square))


@dataclass(frozen=True)
class Potential:
    """The potential psi between ground particles and a view's particles."""

    inlier: Floats
    """float64 (n, m): N(g_n; H^-1 x_m, Gamma_m), 1/square metre."""
    stray: Floats
    """float64 (n,): the outlier term's density at each ground particle."""
    outlier: Outlier
    """The outlier term."""

    @classmethod
    def of(cls, ground: Floats, mapped: Floats, covariance: Floats, outlier: Outlier) -> Potential:
        """Between ground particles (n, 2) and those of a view, mapped (m, 2), with covariances (m, 2, 2), metres."""
        inlier = np.empty((len(ground), len(mapped)))
        fill_inlier(ground, mapped, covariance, inlier)
        return cls(inlier, outlier.density(ground), outlier)

    def to_ground(self, visible_belief: Floats) -> Floats:
        """Message from the view to each ground particle, float64 (n,); seen (m,) are its weights a."""
        share, visible = self.outlier.share, float(visible_belief.sum())
        message = (1 - share) * (self.inlier @ visible_belief) + share * visible * self.stray
        return np.asarray(message + (1 - visible) * self.outlier.flat)

    def to_view(self, weight: Floats) -> Floats:
        """Message from the ground, where particles weigh (n,), to each particle of the view, float64 (m,)."""
        share = self.outlier.share
        return np.asarray((1 - share) * (weight @ self.inlier) + share * float(weight @ self.stray))


@kernel
def fill_inlier(ground: Floats, mapped: Floats, covariance: Floats, inlier: Floats) -> None:
    """Fill (n, m) with the density at ground (n, 2) of Gaussians at mapped (m, 2) with covariance (m, 2, 2)."""
    for m in range(len(mapped)):
        a, b, d = covariance[m, 0, 0], covariance[m, 0, 1], covariance[m, 1, 1]
        determinant = a * d - b * b
        scale = 0.5 / np.pi / np.sqrt(determinant)
        for n in range(len(ground)):
            x, y = ground[n, 0] - mapped[m, 0], ground[n, 1] - mapped[m, 1]
            inlier[n, m] = scale * np.exp(-0.5 * (d * x * x - 2.0 * b * x * y + a * y * y) / determinant)
