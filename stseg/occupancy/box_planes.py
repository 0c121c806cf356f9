"""Likelihood per plane from boxes: each box knows its head and its feet (METHODS 3 'Instances').

    M(X, Z) = max over boxes b and heights h >= Z of N(h) / N(mean) exp(match(b, pillar(X, h)))

is how well the best box fits a body there. A cell is spoken for by the box of the person near it and by boxes that
nobody explains. The body is either missed, or shown by a box that fits that well, where there is clutter anyhow: odds
of r = m + M (1 - m) / b. L(X, Z) is the likelihood that says as much in METHODS 4's log-odds,

    ((1 - m) L + m (1 - L)) / (b L + (1 - b) (1 - L)) = r,

with b' for b within reach of a person. An empty cell's ray then met foreground with a probability of about M (the E
step of `stseg.occupancy.rate_calibration`), so b and b' become the means of M, whatever they were before.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles
from stseg.model.box_fit import half_square
from stseg.occupancy.fusion import ErrorRates


def plane_likelihood(match: Singles, near: Ints, rates: ErrorRates) -> Singles:
    """L of each cell, float32 (plane, y, x), 0..1.

    Parameters
    ----------
    match : float32 (plane, y, x)
        M.
    near : int64 (y, x)
        The person near each cell, -1 for nobody: their surroundings have a clutter of their own.
    rates
        m, b and b' by which the view is fused.
    """
    miss, clutter = rates.miss, np.where(near >= 0, rates.near_clutter, rates.clutter)
    ratio = miss + match * (1 - miss) / clutter
    likelihood = (ratio * (1 - clutter) - miss) / (1 - 2 * miss + ratio * (1 - 2 * clutter))
    return np.asarray(likelihood.clip(0.0, 1.0), np.float32)


@kernel
def fill_match_of_planes(
    bodies: Singles,
    heights: Floats,
    spread: float,
    mean_height: float,
    person_height: Floats,
    planes: Floats,
    boxes: Floats,
    tolerance: Floats,
    belief: Floats,
    box_owner: Ints,
    near: Ints,
    width: float,
    height: float,
    match: Singles,
) -> None:
    """Fill match, M (plane, y, x), of one view.

    Parameters
    ----------
    bodies : float32 (height, y, x, 4)
        Box of the pillar at each cell, pixels; nan where unseen.
    heights : float64 (height,)
        Heights tried, metres; their standard deviation is `spread` about `mean_height`, or about the height of the
        person near the cell: all views see that person equally tall, so it is not held against them view by view.
    person_height : float64 (person,)
        Metres.
    planes : float64 (plane,)
        Heights of the planes, metres.
    tolerance : float64 (5,)
        See `stseg.model.box_fit`.
    boxes, belief, box_owner : (box, 4), (box,), (box,)
        Edges in pixels, log-score, and the person whom each box shows, -1 for nobody.
    near : int64 (y, x)
        The person near each cell, -1 for nobody.
    width, height
        The image's size, pixels.
    """
    body = np.empty(4)
    for y in range(near.shape[0]):
        for x in range(near.shape[1]):
            reached = 0.0
            expected = person_height[near[y, x]] if near[y, x] >= 0 else mean_height
            plane = len(planes) - 1
            for h in range(len(heights) - 1, -1, -1):
                while plane >= 0 and planes[plane] > heights[h]:
                    match[plane, y, x] = reached
                    plane -= 1
                if np.isnan(bodies[h, y, x, 0]):
                    continue
                body[:] = bodies[h, y, x]
                height_prior = -0.5 * ((heights[h] - expected) / spread) ** 2
                for b in range(len(boxes)):
                    if box_owner[b] < 0 or box_owner[b] == near[y, x]:
                        fit = height_prior + belief[b] - half_square(body, boxes[b], tolerance, width, height)
                        reached = max(reached, np.exp(fit))
            while plane >= 0:
                match[plane, y, x] = reached
                plane -= 1
