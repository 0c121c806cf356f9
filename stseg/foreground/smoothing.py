"""Pooling: from log-odds of single pixels to foreground probabilities of their neighbourhoods."""

from __future__ import annotations

import math

import numpy as np

from stseg.arrays import Singles
from stseg.foreground.background.posterior import LOG_ODDS_LIMIT
from stseg.kernels.accelerate import wide_kernel

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
        Nats, no less than -CERTAIN.
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
