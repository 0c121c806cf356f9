"""From log-odds of single pixels to likelihoods that neighbours agree on."""

from __future__ import annotations

import math

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Singles


@kernel
def _across(u: int, width: int, radius: int) -> float:
    """Sum of the weights of the pixels that exist around column u."""
    left, right = max(radius - u, 0), max(radius - (width - 1 - u), 0)
    return (radius + 1) ** 2 - (left * (left + 1) + right * (right + 1)) / 2


@kernel
def pool_log_odds(log_odds: Singles, radius: int, rows: Singles, likelihood: Singles) -> None:
    """Mean of the log-odds around each pixel, as a probability.

    Neighbours mostly show the same thing, so a mean of log-odds (the geometric mean of the odds) removes single noisy
    pixels and blurs borders by `radius` alone. Near ones do so more surely than far ones: along each axis the weight
    falls straight from the pixel itself, to 0 beyond `radius`. At the image's border the mean is over the pixels that
    exist.

    Parameters
    ----------
    log_odds : float32 (v, u)
        Nats.
    radius
        Pixels; 0 for no smoothing.
    rows : float32 (v, u)
        Filled with sums along rows.
    likelihood : float32 (v, u)
        Filled with 1 / (1 + exp(-mean)).
    """
    height, width = log_odds.shape
    for v in range(height):
        for u in range(width):
            rows[v, u] = np.float32(radius + 1) * log_odds[v, u]
        for shift in range(1, radius + 1):
            weight = np.float32(radius + 1 - shift)
            for u in range(width - shift):
                rows[v, u] += weight * log_odds[v, u + shift]
            for u in range(shift, width):
                rows[v, u] += weight * log_odds[v, u - shift]
    for v in range(height):
        first, last = max(0, v - radius), min(height, v + radius + 1)
        for u in range(width):
            likelihood[v, u] = 0
        down = 0.0
        for k in range(first, last):
            weight = np.float32(radius + 1 - abs(k - v))
            down += radius + 1 - abs(k - v)
            for u in range(width):
                likelihood[v, u] += weight * rows[k, u]
        mean, value = 0.0, 0.5
        for u in range(width):
            own = likelihood[v, u] / (down * _across(u, width, radius))
            if own != mean:  # long runs of background have one value: spare the exponential
                mean, value = own, 1.0 / (1.0 + math.exp(-own))
            likelihood[v, u] = value
