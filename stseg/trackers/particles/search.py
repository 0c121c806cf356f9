"""Iterated localisation: segment, find the axes, intersect them, repeat (Kim and Davis 2006, section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats
from stseg.trackers.particles.axes import HELD, meet
from stseg.trackers.particles.views import ParticleFrame

_SETTLED = 0.02
"""A hypothesis that moves less is settled, metres: the paper's epsilon."""


def search(looks: Sequence[ParticleFrame], ground: Floats, rounds: int, median: bool) -> Floats:
    """Converged places from start places (n, 2), float64 (n, 2), metres.

    Parameters
    ----------
    looks
        All views of a frame.
    rounds
        At most so many; the paper found 2 or 3 enough.
    median
        Axes by the least median of squares; else by least squares.
    """
    found = ground.copy()
    axes = np.zeros((len(looks), len(ground), 4))
    for _ in range(rounds):
        for look, own in zip(looks, axes, strict=True):
            look.fill_axes(found, median, own)
        if meet(axes, HELD, found) < _SETTLED:
            break
    return found
