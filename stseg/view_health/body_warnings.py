"""Warnings of bodies that are not as the configuration says, and of views that miss parts of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Rows
from stseg.config import BodyConfig

_LEAST_MEASUREMENTS = 30
"""Least number of measurements for a statement."""
_WIDTH_DEVIATIONS = 3.0
"""Spreads from the configured mean beyond which bodies are others than configured."""
_TORN_MISS_RATE = 0.3
"""Learned miss rate above which a view's bodies are torn; clean masks have 0.05 to 0.2."""


def body_warnings(cameras: Sequence[str], trajectory: Rows, rates: Rows, body: BodyConfig) -> list[str]:
    """Warnings of a run's bodies.

    Parameters
    ----------
    cameras
        Their names.
    trajectory : TRAJECTORY (n,)
        The run's people.
    rates : RATES (n,)
        Its learned error rates.
    body
        The configured population.
    """
    return _sizes(trajectory, body) + _torn(cameras, rates)


def _sizes(trajectory: Rows, body: BodyConfig) -> list[str]:
    if len(trajectory) < _LEAST_MEASUREMENTS:
        return []
    height, width = (float(np.median(trajectory[name])) for name in ("height", "width"))
    usual = float(body.width_of(np.array([height]))[0])
    if width > usual + _WIDTH_DEVIATIONS * body.width_spread:
        return [
            f"bodies are {width:.2f} m wide in the median, {usual:.2f} m were expected: are the masks too wide? "
            "[body] in the rig says whom the cameras watch"
        ]
    return []


def _torn(cameras: Sequence[str], rates: Rows) -> list[str]:
    warnings = []
    for view, name in enumerate(cameras):
        miss = rates["miss"][rates["view"] == view]
        if len(miss) and (share := float(np.median(miss))) > _TORN_MISS_RATE:
            warnings.append(f"view {name} misses {100 * share:.0f} % of people's bodies: are its masks torn or narrow?")
    return warnings
