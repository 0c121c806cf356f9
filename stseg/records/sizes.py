"""Body sizes as Gaussian means and variances, and products of measurements and priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.config import BodyConfig

_UNMEASURED_SHARE = 0.6
"""Share of the population's variance from which on a frame has not measured a size."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of people as means and variances, each float64 (n,); metres and square metres."""

    height: Floats
    height_variance: Floats
    width: Floats
    width_variance: Floats

    @classmethod
    def of_population(cls, number: int, body: BodyConfig) -> Sizes:
        """The population prior."""
        height, width = (body.height_mean, body.height_spread), (body.width_mean, body.width_spread)
        return cls(*(np.full(number, value) for mean, spread in (height, width) for value in (mean, spread**2)))

    @classmethod
    def of_heights(cls, height: Floats, variance: Floats, body: BodyConfig) -> Sizes:
        """Sizes of heights with variances, metres and square metres, each (n,); widths by the population prior."""
        population = cls.of_population(len(height), body)
        return cls(height, variance, population.width, population.width_variance)

    def at(self, chosen: Sequence[int] | Ints) -> Sizes:
        """Sizes of the chosen, in that order."""
        index = np.asarray(chosen, int)
        return Sizes(self.height[index], self.height_variance[index], self.width[index], self.width_variance[index])

    def put(self, chosen: Ints, others: Sizes) -> None:
        """Take others' sizes for the chosen."""
        self.height[chosen], self.height_variance[chosen] = others.height, others.height_variance
        self.width[chosen], self.width_variance[chosen] = others.width, others.width_variance

    def joined_with(self, others: Sizes) -> Sizes:
        """These, then others."""
        pairs = ((getattr(self, one.name), getattr(others, one.name)) for one in fields(Sizes))
        return Sizes(*(np.concatenate(pair) for pair in pairs))

    def measured(self, body: BodyConfig) -> tuple[Floats, Floats]:
        """Heights and widths (n,), metres; nan where these posteriors leave the population's variance as it was."""
        return (
            np.where(self.height_variance < _UNMEASURED_SHARE * body.height_spread**2, self.height, np.nan),
            np.where(self.width_variance < _UNMEASURED_SHARE * body.width_spread**2, self.width, np.nan),
        )

    def as_measurements(self, prior: Sizes) -> Sizes:
        """These posteriors as measurements: the prior taken out of their variances.

        The means still lean to the prior where the frame's evidence is weak; so do those of all frames of a person,
        which are compared with each other.
        """
        return Sizes(
            self.height,
            _without(self.height_variance, prior.height_variance),
            self.width,
            _without(self.width_variance, prior.width_variance),
        )

    def with_prior(self, prior: Sizes) -> Sizes:
        """Posteriors of these measurements with a prior."""
        return Sizes(
            *_product(self.height, self.height_variance, prior.height, prior.height_variance),
            *_product(self.width, self.width_variance, prior.width, prior.width_variance),
        )


_TAIL = 2.0
"""Spreads at which the prior's tails begin."""


def log_heavy_tailed(deviation: Floats) -> Floats:
    """Log density of sizes at a deviation from the mean, in spreads, beside that of the mean: nats.

    A Gaussian, with tails of a power law (its exponent, 4, makes the density smooth): coats, prams and children are far
    out more often than a Gaussian allows. Ten spreads cost 8 nats, not 50.
    """
    away, gaussian = np.abs(deviation), -0.5 * deviation**2
    if (away < _TAIL).all():
        return np.asarray(gaussian)
    tail = 0.5 * _TAIL**2 + _TAIL**2 * np.log(np.maximum(away, _TAIL) / _TAIL)
    return np.where(away < _TAIL, gaussian, -tail)


def log_population_height(height: Floats, body: BodyConfig) -> Floats:
    """Log density of heights in the population, metres, beside that of the mean height: nats."""
    return log_heavy_tailed((height - body.height_mean) / body.height_spread)


def is_rare_height(height: Floats, body: BodyConfig) -> Flags:
    """Whether heights, metres, lie in the tails of the population, as those of children do."""
    return np.asarray(np.abs(height - body.height_mean) > _TAIL * body.height_spread)


_LEAST_PRECISION = 1e-6
"""Precision of an empty measurement, one over square metres."""


def _without(variance: Floats, prior: Floats) -> Floats:
    return 1 / np.maximum(1 / variance - 1 / prior, _LEAST_PRECISION)


def _product(mean: Floats, variance: Floats, other: Floats, other_variance: Floats) -> tuple[Floats, Floats]:
    share = other_variance / (variance + other_variance)
    return other + share * (mean - other), other_variance * (1 - share)
