"""Repulsion of bodies: the pair potential of a Gibbs point process (Moeller and Waagepetersen 2003, section 6.2).

Places of people are a Poisson process whose density is multiplied by exp(-phi(d)) for each pair at a distance d. Soft
bodies may press together, so phi rises linearly from the distance at which they touch, `minimum_distance`. Where views
show pixels there is a hard core besides, within which no two bodies stand: what a wide body leaves over at its rim is
seen by all views alike, and any finite cost is outvoted by enough of them. A box speaks for one person only, and places
from boxes are no better known than the core is wide, so boxes have no core.

Both distances are those of bodies of common width. Wider bodies touch earlier, so d is the distance over the mean of
their widths beside a common one (a process of marked points). Narrow ones get no nearer for it: slim is also what is
left over of a silhouette.
"""

from __future__ import annotations

import numpy as np

from stseg.arrays import Floats
from stseg.kernels.accelerate import part

CORE = 0.05
"""The hard core ends this far below the distance at which bodies touch, metres: at 0.25 m, a body's depth."""
_TOUCH = 2.0
"""Cost of a pair that just touches, nats."""
_COINCIDENCE = 20.0
"""What two soft bodies in one place cost beyond that, nats."""
_EXCLUDED = 1e4
"""Cost of a pair within the hard core, nats: more than all views together say of a person."""


@part
def pair_cost(distance: float, minimum_distance: float, hard_core: float) -> float:
    """Cost of a pair of bodies at a distance, nats; all distances in metres."""
    if distance >= minimum_distance:
        return 0.0
    if distance < hard_core:
        return _EXCLUDED
    return _TOUCH + _COINCIDENCE * (1.0 - distance / minimum_distance)


@part
def apart_of_bodies(i: int, j: int, ground: Floats, breadth: Floats) -> float:
    """Distance of two bodies on the ground float64 (n, 2), as of bodies of common width: metres."""
    distance = np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1])
    return float(2.0 * distance / (breadth[i] + breadth[j]))
