"""Foreground log-odds of a colour from its densities, common to all background models.

With densities per cubed grey level, `lit` of the background as it was learned, `dimmed` of it in shadow, and U of a
colour of which nothing is known (symbols as in `stseg.foreground.mixture`),

    log-odds = log f ((1 - m) U + m dimmed) / ((1 - f) ((1 - e) ((1 - s) lit + s dimmed) + e U)),   within 5 nats.
"""

from __future__ import annotations

import math

import numpy as np

from stseg.accelerate import kernel

UNIFORM = 1.0 / 256.0**3  # density of an unknown colour, per cubed grey level
CERTAIN = 5.0  # nats; beyond it one pixel would outvote all its neighbours
FAR = 50.0  # half a squared Mahalanobis distance; beyond it the density is below every constant here
_ROUNDING = 1.001  # more than single precision loses
_SHORTEST = np.float32(1 / math.sqrt(3))  # no colour is shorter than this share of the sum of its channels
_UNIFORM, _TWO_PI, _TINY = np.float32(UNIFORM), np.float32(2 * math.pi), np.float32(1e-6)
_ZERO, _ONE, _TWO, _SIXTEENTH = np.float32(0), np.float32(1), np.float32(2), np.float32(1 / 16)


@kernel
def bounded_log_odds(
    lit: float, dimmed: float, foreground: float, unexplained: float, shadow: float, mimicry: float
) -> float:
    """The log-odds of a person, nats, within 5."""
    person = (1.0 - mimicry) * UNIFORM + mimicry * dimmed
    scene = (1.0 - unexplained) * ((1.0 - shadow) * lit + shadow * dimmed) + unexplained * UNIFORM
    odds = math.log(foreground * person / ((1.0 - foreground) * scene))
    return min(max(odds, -CERTAIN), CERTAIN)


@kernel
def doubt_of(foreground: float, unexplained: float, shadow: float) -> float:
    """Ratio of the densities of background and people from which on the log-odds are at their lower bound."""
    known = (1.0 - unexplained) * (1.0 - shadow)
    return _ROUNDING * foreground * math.exp(CERTAIN) / ((1.0 - foreground) * known)


@kernel
def surely_background(
    d0: np.float32,
    d1: np.float32,
    d2: np.float32,
    m0: np.float32,
    m1: np.float32,
    m2: np.float32,
    across_variance: np.float32,
    along_variance: np.float32,
    weight: np.float32,
    reach: np.float32,
    doubt: np.float32,
    mimicry: np.float32,
) -> bool:
    """Whether one Gaussian mode alone puts the log-odds at their lower bound, found without exponentials.

    A sufficient condition, true of most pixels: exp(-z) >= (1 - z / 8)^8 bounds both sides.

    Parameters
    ----------
    d0, d1, d2
        The colour less the mode's.
    m0, m1, m2
        The mode's colour, grey levels.
    across_variance, along_variance
        Of a channel, across the ray of the mode's chromaticity and along it, squared grey levels.
    reach
        1 - darkest.
    doubt
        `doubt_of` the priors.
    """
    inner = d0 * m0 + d1 * m1 + d2 * m2
    along = inner * inner / (m0 * m0 + m1 * m1 + m2 * m2 + _TINY)
    across = d0 * d0 + d1 * d1 + d2 * d2 - along
    area, span = _TWO_PI * across_variance, np.sqrt(_TWO_PI * along_variance)
    line = span + reach * _SHORTEST * (m0 + m1 + m2)
    return outshines(across / across_variance, along / along_variance, area, span, line, weight, doubt, mimicry)


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
    near, level = max(_ONE - _SIXTEENTH * (across + along), _ZERO), max(_ONE - _SIXTEENTH * along, _ZERO)
    near, level = near * near, level * level
    near, level = near * near, level * level
    near, level = near * near, level * level
    person = _UNIFORM * area * line * level + _TWO * mimicry * weight * near
    return bool(doubt * span * person < weight * near * level * line)
