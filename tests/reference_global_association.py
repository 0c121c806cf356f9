"""Plain twin of global association: every one-to-one choice of links, each gain written out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stseg.config import Config
from stseg.tracking.isolated_tracklets import IsolatedTracklet

STAYS, PARTED = 3.0, 6.0


def log_normal(off: float, variance: float) -> float:
    """Log of the density of a normal variable."""
    return float(-0.5 * off**2 / variance - 0.5 * np.log(2 * np.pi * variance))


def gain(
    a: IsolatedTracklet,
    b: IsolatedTracklet,
    inside: float,
    frame_rate: float,
    config: Config,
) -> float:
    """Log-likelihood ratio of one person in both, nats; `inside` is the mean of how far inside they part."""
    seconds = (b.start.frame - a.end.frame) / frame_rate
    if seconds <= 0 or seconds > config.tracking.maximum_gap:
        return -np.inf
    speeds = a.end.velocity_variance + b.start.velocity_variance
    variance = (
        2 * config.motion.position_noise**2
        + seconds**2 * speeds / 4
        + config.motion.velocity_noise**2 * seconds**3 / 12
    )
    total = PARTED * inside + (STAYS if a.track == b.track else 0.0)
    for axis in range(2):
        walked = seconds * (a.end.velocity[axis] + b.start.velocity[axis]) / 2
        total += log_normal(b.start.ground[axis] - a.end.ground[axis] - walked, variance)
    one = log_normal(a.height - b.height, a.height_variance + b.height_variance)
    two = log_normal(a.height - b.height, 2 * config.body.height_spread**2)
    return total + one - two


def choices(number: int, first: int = 0, taken: frozenset[int] = frozenset()) -> Iterator[list[tuple[int, int]]]:
    """Every set of links from earlier to later tracklets in which none has two before it or two after it."""
    if first == number:
        yield []
        return
    for rest in choices(number, first + 1, taken):
        yield rest
    for later in range(first + 1, number):
        if later not in taken:
            for rest in choices(number, first + 1, taken | {later}):
                yield [(first, later), *rest]


def greatest_sum(gains: Sequence[Sequence[float]]) -> float:
    """Greatest gain of any one-to-one choice of links."""
    return max(sum(gains[a][b] for a, b in chosen) for chosen in choices(len(gains)))
