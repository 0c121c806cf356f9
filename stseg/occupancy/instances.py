"""Likelihood per plane from boxes: each box knows its head and its feet (METHODS 3 'Instances').

    L(X, Z) = max over boxes b and heights h >= Z of N(h) / N(mean) exp(match(b, pillar(X, h)))

A cell is spoken for by the box of the person near it and by boxes that nobody explains.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles
from stseg.ghosts.boxes import half_square


@kernel
def fill_likelihood(
    bodies: Singles,
    heights: Floats,
    spread: float,
    mean_height: float,
    person_height: Floats,
    planes: Floats,
    boxes: Floats,
    belief: Floats,
    box_owner: Ints,
    near: Ints,
    width: float,
    height: float,
    likelihood: Singles,
) -> None:
    """Fill likelihood (plane, y, x) of one view.

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
                    likelihood[plane, y, x] = reached
                    plane -= 1
                if np.isnan(bodies[h, y, x, 0]):
                    continue
                body[:] = bodies[h, y, x]
                height_prior = -0.5 * ((heights[h] - expected) / spread) ** 2
                for b in range(len(boxes)):
                    if box_owner[b] < 0 or box_owner[b] == near[y, x]:
                        fit = height_prior + belief[b] - half_square(body, boxes[b], width, height)
                        reached = max(reached, np.exp(fit))
            while plane >= 0:
                likelihood[plane, y, x] = reached
                plane -= 1
