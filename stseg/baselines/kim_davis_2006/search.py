"""Iterated localisation: segment, find the axes, intersect them, repeat (Kim and Davis 2006, section 3.3, eq. 5)."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats
from stseg.baselines.kim_davis_2006.axes import HYPOTHESIS_WEIGHT, intersect_axes
from stseg.baselines.kim_davis_2006.views import ParticleFrame

_CONVERGED = 0.02
"""Largest shift of a converged hypothesis, metres: the paper's epsilon."""


def search(views: Sequence[ParticleFrame], ground: Floats, rounds: int, median: bool) -> Floats:
    """Converged places from initial places (n, 2), float64 (n, 2), metres.

    Parameters
    ----------
    views
        All views of a frame.
    rounds
        Most iterations; the paper found 2 or 3 enough.
    median
        Axes by the least median of squares; else by least squares.
    """
    found = ground.copy()
    axes = np.zeros((len(views), len(ground), 4))
    for _ in range(rounds):
        for view, view_axes in zip(views, axes, strict=True):
            view.fill_axes(found, median, view_axes)
        if intersect_axes(axes, HYPOTHESIS_WEIGHT, found) < _CONVERGED:
            break
    return found
