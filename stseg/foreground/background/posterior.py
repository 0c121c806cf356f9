"""Foreground log-odds of a colour from its densities, common to all background models.

With densities per cubed grey level, `lit` of the background as it was learned, `dimmed` of it in shadow, and U of a
colour of which nothing is known (symbols as in `stseg.foreground.background.mixture`),

    log-odds = log f ((1 - m) U + m dimmed) / ((1 - f) ((1 - e) ((1 - s) lit + s dimmed) + e U)),   within 5 nats.
"""

from __future__ import annotations

import math

import numpy as np

from stseg.kernels.accelerate import kernel

UNIFORM_DENSITY = 1.0 / 256.0**3  # density of an unknown colour, per cubed grey level
LOG_ODDS_LIMIT = 5.0  # nats; beyond it one pixel would outvote all its neighbours
EXPONENT_LIMIT = 50.0  # half a squared Mahalanobis distance; beyond it the density is below every constant here
_CERTAIN_RATIO = math.exp(LOG_ODDS_LIMIT)
_ROUNDING = 1.001  # more than single precision loses
_UNIFORM = np.float32(UNIFORM_DENSITY)
_ZERO, _ONE, _TWO, _SIXTEENTH = np.float32(0), np.float32(1), np.float32(2), np.float32(1 / 16)


@kernel
def bounded_log_odds(
    lit: float, dimmed: float, foreground: float, unexplained: float, shadow: float, mimicry: float
) -> float:
    """The log-odds of a person, nats, within 5."""
    person = (1.0 - mimicry) * UNIFORM_DENSITY + mimicry * dimmed
    scene = (1.0 - unexplained) * ((1.0 - shadow) * lit + shadow * dimmed) + unexplained * UNIFORM_DENSITY
    ratio = foreground * person / ((1.0 - foreground) * scene)
    if ratio >= _CERTAIN_RATIO:
        return LOG_ODDS_LIMIT
    return max(math.log(ratio), -LOG_ODDS_LIMIT) if ratio * _CERTAIN_RATIO > 1.0 else -LOG_ODDS_LIMIT


@kernel
def doubt_of(foreground: float, unexplained: float, shadow: float) -> float:
    """Ratio of the densities of background and people from which on the log-odds are at their lower bound."""
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
    person = _UNIFORM * area * line * level + _TWO * mimicry * weight * closeness
    return bool(doubt * span * person < weight * closeness * level * line)
