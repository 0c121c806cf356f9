"""The belief of a node of the star: weighted particles, and their prediction (Du and Piater 2006, equation 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.kernels.accelerate import kernel


@dataclass(frozen=True)
class Particles:
    """A node's belief; places are metres on the ground or pixels of the ideal image, as the node's are."""

    place: Floats
    velocity: Floats
    """float64 (n, 2) each; velocities are of one second."""
    weight: Floats
    """float64 (n,): their sum is 1."""

    def __len__(self) -> int:
        return len(self.place)

    @property
    def mean(self) -> Floats:
        """Mean place, float64 (2,)."""
        return np.asarray(self.weight @ self.place)

    @property
    def covariance(self) -> Floats:
        """Covariance of the place, float64 (2, 2)."""
        deviation = self.place - self.mean
        return np.asarray((self.weight * deviation.T) @ deviation)


@dataclass(frozen=True)
class Motion:
    """Process noise of a constant-velocity model over one frame."""

    seconds: float
    """Length of a frame."""
    position_noise: float
    """Standard deviation of the place, metres per square root of a second."""
    velocity_noise: float
    """Standard deviation of the velocity, metres per second per square root of a second."""

    @property
    def place_variance(self) -> float:
        """Variance of the place after a frame, square metres."""
        return self.position_noise**2 * self.seconds + self.velocity_noise**2 * self.seconds**3 / 3

    @property
    def gain(self) -> float:
        """Regression of the velocity on the place, 1/s: covariance over variance."""
        return self.velocity_noise**2 * self.seconds**2 / 2 / self.place_variance

    @property
    def velocity_variance(self) -> float:
        """Variance of the velocity given the place, square metres per square second."""
        return self.velocity_noise**2 * self.seconds - self.gain**2 * self.place_variance


@dataclass(frozen=True)
class Prediction:
    """The integrals over the last frame in Du and Piater 2006, equations 8 to 11: one Gaussian for each particle."""

    centre: Floats
    velocity: Floats
    """float64 (n, 2) each: predicted places, which are the Gaussians' centres, and velocities."""
    weight: Floats
    """float64 (n,): weights of the particles."""
    axes: Floats
    """float64 (2, 2): jacobian from ground metres to the node's own units; the unit matrix on the ground."""
    motion: Motion
    """Process noise: the Gaussians' spread."""

    @classmethod
    def of(cls, particles: Particles, axes: Floats, motion: Motion) -> Prediction:
        """One frame later, at constant velocity."""
        centre = particles.place + motion.seconds * particles.velocity
        return cls(centre, particles.velocity, particles.weight, axes, motion)

    @property
    def covariance(self) -> Floats:
        """Covariance of one Gaussian, float64 (2, 2)."""
        return np.asarray(self.motion.place_variance * self.axes @ self.axes.T)

    @property
    def mean(self) -> Floats:
        """Mean place, float64 (2,)."""
        return np.asarray(self.weight @ self.centre)

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Places drawn from the mixture, float64 (count, 2)."""
        chosen = systematic(self.weight, count, rng.random())
        deviation = rng.standard_normal((count, 2)) @ self.axes.T
        return np.asarray(self.centre[chosen] + self.motion.place_variance**0.5 * deviation)

    def density(self, place: Floats) -> Floats:
        """Density of the mixture at places (k, 2), float64 (k,)."""
        filled, (inverse, scale) = np.empty(len(place)), _gaussian(self.covariance)
        fill_mixture(place, self.centre, self.weight, inverse, scale, filled)
        return filled

    def settled(self, place: Floats, weight: Floats, rng: np.random.Generator) -> Particles:
        """Particles at places (k, 2) of weights (k,), with velocities drawn given the particles that they came from."""
        inverse, _ = _gaussian(self.covariance)
        origin = np.empty(len(place), np.int64)
        fill_origin(place, self.centre, self.weight, inverse, rng.random(len(place)), origin)
        deviation = rng.standard_normal((len(place), 2)) @ self.axes.T
        change = self.motion.gain * (place - self.centre[origin]) + self.motion.velocity_variance**0.5 * deviation
        return Particles(place, self.velocity[origin] + change, weight)


def systematic(weight: Floats, count: int, offset: float) -> Ints:
    """Indices drawn by weight: systematic resampling with one random offset, 0..1; int64 (count,)."""
    cumulative = np.cumsum(weight)
    steps = (np.arange(count) + offset) / count * cumulative[-1]
    return np.asarray(np.minimum(np.searchsorted(cumulative, steps, side="right"), len(weight) - 1), np.int64)


def _gaussian(covariance: Floats) -> tuple[Floats, float]:
    """xx, xy, yy of the inverse, float64 (3,), and the density at the centre."""
    (a, b), (_, d) = covariance
    determinant = a * d - b * b
    return np.array([d, -b, a]) / determinant, float(0.5 / np.pi / np.sqrt(determinant))


@kernel
def fill_mixture(place: Floats, centre: Floats, weight: Floats, inverse: Floats, scale: float, filled: Floats) -> None:
    """Fill (k,) with the density at places (k, 2) of Gaussians of one covariance at centres (n, 2)."""
    for i in range(len(place)):
        total = 0.0
        for r in range(len(centre)):
            x, y = place[i, 0] - centre[r, 0], place[i, 1] - centre[r, 1]
            total += weight[r] * np.exp(-0.5 * (inverse[0] * x * x + 2.0 * inverse[1] * x * y + inverse[2] * y * y))
        filled[i] = scale * total


@kernel
def fill_origin(place: Floats, centre: Floats, weight: Floats, inverse: Floats, uniform: Floats, origin: Ints) -> None:
    """Fill (k,) with one Gaussian each, drawn by its density at the place with random numbers (k,).

    The exponents are taken relative to the least, so that places far from all Gaussians select the nearest.
    """
    square, cumulative = np.empty(len(centre)), np.empty(len(centre))
    for i in range(len(place)):
        least, total = np.inf, 0.0
        for r in range(len(centre)):
            x, y = place[i, 0] - centre[r, 0], place[i, 1] - centre[r, 1]
            square[r] = inverse[0] * x * x + 2.0 * inverse[1] * x * y + inverse[2] * y * y
            if weight[r] > 0.0:
                least = min(least, square[r])
        for r in range(len(centre)):
            total += weight[r] * np.exp(-0.5 * (square[r] - least)) if weight[r] > 0.0 else 0.0
            cumulative[r] = total
        origin[i] = 0
        while origin[i] < len(centre) - 1 and cumulative[origin[i]] <= uniform[i] * total:
            origin[i] += 1
