"""Repulsion of bodies: the pair potential of a Gibbs point process (Moeller and Waagepetersen 2003, section 6.2).

Places of people are a Poisson process whose density is multiplied by exp(-phi(d)) for each pair at a distance d. Soft
bodies may press together, so phi rises linearly from the distance at which they touch, `minimum_distance`. Where views
show pixels there is a hard core besides, within which no two bodies stand: what a wide body leaves over at its rim is
seen by all views alike, and any finite cost is outvoted by enough of them. A box speaks for one person only, and places
from boxes are no better known than the core is wide, so boxes have no core.
"""

from __future__ import annotations

from stseg.accelerate import kernel

CORE = 0.05
"""The hard core ends this far below the distance at which bodies touch, metres: at 0.25 m, a body's depth."""
_TOUCH = 2.0
"""Cost of a pair that just touches, nats."""
_COINCIDENCE = 20.0
"""What two soft bodies in one place cost beyond that, nats."""
_EXCLUDED = 1e4
"""Cost of a pair within the hard core, nats: more than all views together say of a person."""


@kernel
def pair_cost(distance: float, minimum_distance: float, hard_core: float) -> float:
    """Cost of a pair of bodies at a distance, nats; all distances in metres."""
    if distance >= minimum_distance:
        return 0.0
    if distance < hard_core:
        return _EXCLUDED
    return _TOUCH + _COINCIDENCE * (1.0 - distance / minimum_distance)
