"""A particle filter on the joint state of all places (Kim and Davis 2006, section 4).

A particle is the places of all people, float64 (n, 2); particles are float64 (particle, n, 2), metres.
"""

import numpy as np

from stseg.arrays import Floats


def predicted_particles(particles: Floats, spread: float, rng: np.random.Generator) -> Floats:
    """A step of a random walk with a standard deviation of `spread`, metres."""
    return particles + rng.normal(0.0, spread, particles.shape)


def particle_weights(misfit: Floats, sharpness: float) -> Floats:
    """Eq. 7: the weight of each particle by its sum of d^2, float64 (particle,), with lambda; they sum to 1."""
    raw = np.exp(-sharpness * (misfit - misfit.min()))
    return np.asarray(raw / raw.sum())


def resampled(particles: Floats, weight: Floats, rng: np.random.Generator) -> Floats:
    """Systematic resampling: as many particles, drawn at evenly spaced quantiles from a random first one."""
    count = len(particles)
    quantile = (np.arange(count) + rng.random()) / count
    drawn = np.searchsorted(np.cumsum(weight), quantile).clip(0, count - 1)
    return np.asarray(particles[drawn])


def estimate(particles: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """The mean place of each person and the particles' covariance about it, float64 (n, 2), (n, 2, 2)."""
    mean = np.einsum("p,pkc->kc", weight, particles)
    deviation = particles - mean
    return mean, np.asarray(np.einsum("p,pkc,pkd->kcd", weight, deviation, deviation))
