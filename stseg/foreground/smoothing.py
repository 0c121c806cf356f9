"""From log-odds of single pixels to likelihoods that neighbours agree on."""

from __future__ import annotations

import math

from stseg.accelerate import kernel
from stseg.arrays import Singles


@kernel
def pool_log_odds(log_odds: Singles, radius: int, rows: Singles, likelihood: Singles) -> None:
    """Mean of the log-odds over a square around each pixel, as a probability.

    Neighbours mostly show the same thing, so a mean of log-odds (the geometric mean of the odds) removes single noisy
    pixels and blurs borders by `radius` alone. At the image's border the mean is over the pixels that exist.

    Parameters
    ----------
    log_odds : float32 (v, u)
        Nats.
    radius
        Pixels; the square has a side of 2 radius + 1. 0 for no smoothing.
    rows : float32 (v, u)
        Filled with sums along rows.
    likelihood : float32 (v, u)
        Filled with 1 / (1 + exp(-mean)).
    """
    height, width = log_odds.shape
    for v in range(height):
        for u in range(width):
            rows[v, u] = log_odds[v, u]
        for shift in range(1, radius + 1):
            for u in range(width - shift):
                rows[v, u] += log_odds[v, u + shift]
            for u in range(shift, width):
                rows[v, u] += log_odds[v, u - shift]
    for v in range(height):
        first, last = max(0, v - radius), min(height, v + radius + 1)
        for u in range(width):
            likelihood[v, u] = rows[first, u]
        for k in range(first + 1, last):
            for u in range(width):
                likelihood[v, u] += rows[k, u]
        mean, value = 0.0, 0.5
        for u in range(width):
            count = (last - first) * (min(width, u + radius + 1) - max(0, u - radius))
            own = likelihood[v, u] / count
            if own != mean:  # long runs of background have one value: spare the exponential
                mean, value = own, 1.0 / (1.0 + math.exp(-own))
            likelihood[v, u] = value
