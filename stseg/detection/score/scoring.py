"""Score of a set of people: its posterior log-odds against the empty set, each piece of evidence used once.

    score(S) = sum_j [person + height_j - birth_j] + tracks(S) + sum_views sum_j part_j(S) - crowding(S)

Members that continue predicted tracks are no births: tracks(S) = sum of birth_j + gain_jk over the pairs of member j
and track k, one to one, that is greatest.
In a view with boxes, part_j is the best box that no other member takes, or the cost of a missing one, which is less
the more of j is hidden by nearer members. In a view with pixels, part_j is the mean log-odds over j's outline of the
pixels that no nearer member covers (HW12's detection energy, eqs 13 to 15, in soft form, for the labels of eq. 24); in
the image of a body that explains more, over as many pixels as that one explains (`blob_scale`).

crowding(S) is the repulsion of bodies, the pair potential of a Gibbs point process (Moeller and Waagepetersen 2003,
section 6.2): places of people are a Poisson process with its density multiplied by exp(-phi(d)) for each pair at a
distance d. Soft bodies may press together, so phi rises linearly from the distance at which they touch,
`minimum_distance`. Where views show pixels there is a hard core besides, within which no two bodies stand: the strip
that a wide body leaves unexplained at its sides shows in all views alike, and any finite cost is outvoted by enough of
them. A box is evidence for one person only, and places from boxes are no better known than the core is wide, so boxes
have no core. Wider bodies touch earlier, so d is the distance over the mean of their widths relative to a common one (a
process of marked points). Narrow ones get no nearer for it: the remains of a silhouette are slim, too.
"""

import numpy as np

from stseg.arrays import Floats
from stseg.detection.problem import ScoreParameters
from stseg.kernels.accelerate import part

CORE_MARGIN = 0.05
"""The hard core ends this far below the distance at which bodies touch, metres: at 0.25 m, a body's depth."""
_CONTACT_COST = 2.0
"""Cost of a pair that just touches, nats."""
_COINCIDENCE_COST = 20.0
"""Further cost of two soft bodies in one place, nats."""
_CORE_COST = 1e4
"""Cost of a pair within the hard core, nats: more than the evidence of all views for a person."""
_ROUNDING_RATIO = 1.0 + 1e-9
"""Ratio of two distances above which rounding errors do not matter."""


@part
def contact_limit(breadth: Floats, parameters: ScoreParameters) -> float:
    """A distance beyond which no pair costs anything, metres."""
    widest = 0.0
    for i in range(len(breadth)):
        widest = max(widest, breadth[i])
    return float(_ROUNDING_RATIO * parameters.minimum_distance * widest)


@part
def pair_cost(i: int, j: int, ground: Floats, breadth: Floats, parameters: ScoreParameters) -> float:
    """Cost of one pair, nats."""
    contact = 0.5 * _ROUNDING_RATIO * parameters.minimum_distance * (breadth[i] + breadth[j])
    if abs(ground[i, 0] - ground[j, 0]) > contact:  # most pairs are decided here
        return 0.0
    distance = body_distance(i, j, ground, breadth)
    if distance >= parameters.minimum_distance:
        return 0.0
    if distance < parameters.hard_core:
        return _CORE_COST
    return float(_CONTACT_COST + _COINCIDENCE_COST * (1.0 - distance / parameters.minimum_distance))


@part
def body_distance(i: int, j: int, ground: Floats, breadth: Floats) -> float:
    """Distance of two bodies on the ground float64 (n, 2), as of bodies of common width: metres."""
    distance = np.hypot(ground[i, 0] - ground[j, 0], ground[i, 1] - ground[j, 1])
    return float(2.0 * distance / (breadth[i] + breadth[j]))


@part
def missing_box_cost(visible: float, parameters: ScoreParameters) -> float:
    """Cost of a missing box of a body of which such a share is visible, nats."""
    share = min(max(visible / parameters.full_visibility, parameters.hidden_detection_rate), 1.0)
    return float(np.log(1.0 - (1.0 - parameters.box_miss_rate) * share))
