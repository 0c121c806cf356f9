"""Torn masks: silhouettes of which much is missing, read by rates of misses and clutter other than the usual ones.

The rates of a session are learned from people who are found (`stseg.noise.rim_estimate`), and by the usual rates only
the least torn people are. So a young session explains frames in which much is unexplained by a guess of torn rates,
too, and learns from the explanation under which its masks are more likely, each by its best rates: with n pixels inside
the outlines of the people or outside, k of them foreground,

    log p = sum over views, inside and outside, of k log(k / n) + (n - k) log((n - k) / n).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import xlogy

from stseg.arrays import Shorts
from stseg.bodies.views import ViewObservation, ViewObservations

TORN_RATES = (0.5, 0.02)
"""Guess of the rates of misses and clutter of torn masks."""
_LARGEST_UNEXPLAINED = 0.25
"""Share of the foreground that lies outside the outlines of whole silhouettes at most: limbs, shadows, noise."""


def with_rates(observation: ViewObservation, usual: tuple[float, float], rates: tuple[float, float]) -> ViewObservation:
    """An observation of pixels by other rates of misses and clutter than the usual ones: log-odds of one likelihood."""
    if rates == usual:
        return observation
    (miss, clutter), ratio = usual, np.exp(observation.raster)
    share = (ratio * (1.0 - clutter) - miss) / (1.0 - 2.0 * miss + ratio * (1.0 - 2.0 * clutter))
    miss, clutter = rates
    body, empty = (wrong + share * (right - wrong) for wrong, right in ((miss, 1 - miss), (1 - clutter, clutter)))
    return replace(observation, raster=np.log(body / empty).astype(np.float32))


def is_unexplained(assignment: Sequence[Shorts], observations: ViewObservations) -> bool:
    """Whether more of the foreground lies outside the outlines of people than limbs that are no part of a pillar.

    `assignment` are int16 arrays (v, u): the person at each raster pixel of a view, -1 for none.
    """
    pairs = [(people, view.raster > 0) for people, view in zip(assignment, observations, strict=True) if view]
    outside = sum(np.count_nonzero(found[people < 0]) for people, found in pairs if found.size)
    return bool(outside > _LARGEST_UNEXPLAINED * sum(np.count_nonzero(found) for _, found in pairs))


def mask_log_likelihood(assignment: Sequence[Shorts], observations: ViewObservations) -> float:
    """Log likelihood of the masks of all views by the best rates of each, nats; `assignment` as of `is_unexplained`."""
    total = 0.0
    for people, view in zip(assignment, observations, strict=True):
        if view is not None and view.raster.size:
            for foreground in (view.raster[people >= 0] > 0, view.raster[people < 0] > 0):
                n, k = foreground.size, np.count_nonzero(foreground)
                total += float(xlogy([k, n - k], [k / max(n, 1), (n - k) / max(n, 1)]).sum())
    return total
