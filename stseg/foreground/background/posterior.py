"""Foreground log-odds of a colour from its densities, and their pooling over neighbours: common to all models.

With densities per cubed grey level, `lit` of the background as it was learned, `dimmed` of it in shadow, and U of a
colour of which nothing is known, in the cube of colours or on the line of greys (symbols as in the module `mixture`),

    log-odds = log f ((1 - m) U + m dimmed) / ((1 - f) ((1 - e) ((1 - s) lit + s dimmed) + e U)),   within 5 nats.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Singles
from stseg.config import BackgroundConfig
from stseg.kernels.accelerate import kernel, wide_kernel

UNIFORM_DENSITY = 1.0 / 256.0**3  # density of an unknown colour, per cubed grey level
LOG_ODDS_LIMIT = 5.0  # nats; beyond it one pixel would outvote all its neighbours
EXPONENT_LIMIT = 50.0  # half a squared Mahalanobis distance; beyond it the density is below every constant here
_CERTAIN_RATIO = math.exp(LOG_ODDS_LIMIT)
_ROUNDING = 1.001  # more than single precision loses
_GREY_DENSITY = 1.0 / (256.0 * math.sqrt(3.0))  # of an unknown grey along the axis of grey, per grey level
_ZERO, _ONE, _TWO, _SIXTEENTH = np.float32(0), np.float32(1), np.float32(2), np.float32(1 / 16)


class Priors(NamedTuple):
    """Constants of the posterior that all models share, of `stseg.config.BackgroundConfig`."""

    foreground_prior: float
    outlier_rate: float
    shadow_prior: float
    darkest_shadow: float
    shadow_confusion: float
    uniform: float
    """U: density of a colour of which nothing is known, per cubed grey level."""

    @classmethod
    def of(cls, config: BackgroundConfig) -> Self:
        """Those of a configuration, for colours."""
        given = {name: float(getattr(config, name)) for name in cls._fields[:-1]}
        return cls(**given, uniform=UNIFORM_DENSITY)

    def of_greys(self, spread: float) -> Self:
        """The same for a camera without colours: greys, with a standard deviation across their axis, grey levels."""
        return self._replace(uniform=_GREY_DENSITY / (2.0 * math.pi * spread**2))


@kernel
def bounded_log_odds(lit: float, dimmed: float, priors: Priors) -> float:
    """The log-odds of a person, nats, within 5."""
    foreground, unexplained, shadow, _, mimicry, uniform = priors
    person = (1.0 - mimicry) * uniform + mimicry * dimmed
    scene = (1.0 - unexplained) * ((1.0 - shadow) * lit + shadow * dimmed) + unexplained * uniform
    ratio = foreground * person / ((1.0 - foreground) * scene)
    if ratio >= _CERTAIN_RATIO:
        return LOG_ODDS_LIMIT
    return max(math.log(ratio), -LOG_ODDS_LIMIT) if ratio * _CERTAIN_RATIO > 1.0 else -LOG_ODDS_LIMIT


@kernel
def doubt_of(priors: Priors) -> float:
    """Ratio of the densities of background and people from which on the log-odds are at their lower bound."""
    foreground, unexplained, shadow, _, _, _ = priors
    lit_share = (1.0 - unexplained) * (1.0 - shadow)
    return _ROUNDING * foreground * math.exp(LOG_ODDS_LIMIT) / ((1.0 - foreground) * lit_share)


@kernel
def outshines(
    across: np.float32,
    along: np.float32,
    area: np.float32,
    span: np.float32,
    line: np.float32,
    weight: np.float32,
    doubt: np.float32,
    mimicry: np.float32,
    uniform: np.float32,
) -> bool:
    """Whether a single background mode exceeds the density of people `doubt` times (a sufficient condition).

    Parameters
    ----------
    across, along
        Squared Mahalanobis distances from the lit background, across the ray of its chromaticity and along it.
    area
        Over which its density is spread across the ray, squared grey levels.
    span, line
        The lengths over which it is spread along the ray where lit, and where dimmed, grey levels.
    """
    closeness, level = max(_ONE - _SIXTEENTH * (across + along), _ZERO), max(_ONE - _SIXTEENTH * along, _ZERO)
    closeness, level = closeness * closeness, level * level
    closeness, level = closeness * closeness, level * level
    closeness, level = closeness * closeness, level * level
    person = uniform * area * line * level + _TWO * mimicry * weight * closeness
    return bool(doubt * span * person < weight * closeness * level * line)


_NEAR_BOUND = np.float32(1e-5 - LOG_ODDS_LIMIT)  # means of certain background are the bound but for rounding


@wide_kernel
def pool_log_odds(log_odds: Singles, radius: int, likelihood: Singles) -> None:
    """Mean of the log-odds around each pixel, as a probability.

    Neighbours mostly show the same thing, so a mean of log-odds (the geometric mean of the odds) removes single noisy
    pixels and blurs borders by `radius` alone. Along each axis the weight falls linearly from the pixel itself, to 0
    beyond `radius`. At the image's border the mean is over the pixels that exist.

    Parameters
    ----------
    log_odds : float32 (v, u)
        Nats, no less than -LOG_ODDS_LIMIT.
    radius
        Pixels; 0 for no smoothing.
    likelihood : float32 (v, u)
        Filled with 1 / (1 + exp(-mean)).
    """
    height, width = log_odds.shape
    down, mean, share = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    lowest = np.float32(1.0 / (1.0 + math.exp(LOG_ODDS_LIMIT)))
    for u in range(width):
        share[u] = np.float32(1.0 / _weight_within(u, width, radius))
    for v in range(height):
        scale = np.float32(1.0 / _weight_within(v, height, radius))
        down[:] = np.float32(0)
        for k in range(max(0, v - radius), min(height, v + radius + 1)):
            _add(scale * np.float32(radius + 1 - abs(k - v)), log_odds[k], down)
        for u in range(width):
            mean[u] = np.float32(radius + 1) * down[u]
        for shift in range(1, radius + 1):
            weight = np.float32(radius + 1 - shift)
            _add(weight, down[shift:], mean[: width - shift])
            _add(weight, down[: width - shift], mean[shift:])
        for u in range(width):
            mean[u] *= share[u]
            likelihood[v, u] = lowest
        last, value = np.float32(np.nan), lowest
        for u in range(width):
            if mean[u] > _NEAR_BOUND:  # few are, and of those that nothing explains all are the same
                if mean[u] != last:
                    last = mean[u]
                    value = np.float32(1) / (np.float32(1) + np.exp(-last))
                likelihood[v, u] = value


@wide_kernel
def _add(weight: np.float32, values: Singles, total: Singles) -> None:
    """Add weighted values to total, both (u,): without arithmetic on places it becomes vector code."""
    for u in range(len(total)):
        total[u] += weight * values[u]


@wide_kernel
def _weight_within(place: int, extent: int, radius: int) -> float:
    """Sum of the weights around a place of those of `extent` places that exist."""
    before, after = max(radius - place, 0), max(radius - (extent - 1 - place), 0)
    return (radius + 1) ** 2 - (before * (before + 1) + after * (after + 1)) / 2
