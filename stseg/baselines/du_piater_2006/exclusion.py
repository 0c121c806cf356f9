"""Mutual exclusion of targets on the ground: a factor of the ground's belief (Du and Piater 2006, eq. 10).

Du and Piater 2006 follow one target. Here the ground nodes of targets are joined in pairs by the potential

    phi(g, h) = 1 - exp(-|g - h|^2 / (2 s^2)),

with s the distance below which two bodies would overlap, after the interaction potential of Khan, Balch and Dellaert
(MCMC-based particle filtering for tracking a variable number of interacting targets, 2005, section III). So every other
target sends a target's ground the message e(g) = sum_n b_n phi(g, h_n), with b_n and h_n the other's weights and
particles. In the views occlusion keeps targets apart: see `TargetLikelihood.nearer`.
"""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats
from stseg.baselines.du_piater_2006.particles import Particles
from stseg.kernels.accelerate import kernel

_CUTOFF = 6.0
"""Distance of two targets' means beyond which the factor is 1, in s and in their own standard deviations."""


def exclusion(ground: Floats, others: Sequence[Particles], distance: float) -> Floats:
    """Product of other targets' factors at ground points (n, 2), float64 (n,), 0..1; `distance` is s, metres."""
    message = np.ones(len(ground))
    low, high = ground.min(0) - _CUTOFF * distance, ground.max(0) + _CUTOFF * distance
    for other in others:
        overlapping = ((other.place >= low) & (other.place <= high)).all(1)
        if overlapping.any():
            fill_exclusion(ground, other.place[overlapping], other.weight[overlapping], distance, message)
    return message


@kernel
def fill_exclusion(ground: Floats, place: Floats, weight: Floats, distance: float, message: Floats) -> None:
    """Multiply the message (n,) by that of one other target, with particles at places (m, 2), at ground (n, 2)."""
    for n in range(len(ground)):
        overlap = 0.0
        for m in range(len(place)):
            x, y = ground[n, 0] - place[m, 0], ground[n, 1] - place[m, 1]
            overlap += weight[m] * np.exp(-0.5 * (x * x + y * y) / distance**2)
        message[n] *= max(1.0 - overlap, 0.0)
