"""How well boxes fit pillars, and how pillars hide each other (METHODS 3 'Instances').

A box is compared with the box of the pillar, both clipped to the image: sharp at the head, less so at the sides, loose
at the feet where the box ends early, because nearer people and furniture hide feet. Tolerances are shares of the
body's height, so they mean the same near and far.
"""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats

SIDE, WIDTH, HEAD, FEET = 0.06, 0.15, 0.045, 0.06
"""Standard deviations as shares of the body's height: middle, width, upper edge, lower edge."""
EARLY_FEET = 4.0
"""How many times looser the lower edge is where the box ends above the feet."""
PIXELS = 2.0
"""Added to every tolerance, pixels: what a detector's grid cannot tell."""
_FAR = 4.5


@kernel
def half_square(body: Floats, box: Floats, width: float, height: float) -> float:
    """Half the squared Mahalanobis distance of a box from a pillar's box, both left, top, right, bottom in pixels."""
    left, right = min(max(body[0], 0.0), width - 1.0), min(max(body[2], 0.0), width - 1.0)
    top, bottom = min(max(body[1], 0.0), height - 1.0), min(max(body[3], 0.0), height - 1.0)
    if right <= left or bottom <= top:
        return np.inf
    tall = max(body[3] - body[1], 8.0)
    middle = ((left + right) - (box[0] + box[2])) / 2.0 / (SIDE * tall + PIXELS)
    if abs(middle) > _FAR:
        return np.inf
    wide = ((right - left) - (box[2] - box[0])) / (WIDTH * tall + PIXELS)
    head = (top - box[1]) / (HEAD * tall + PIXELS)
    feet = (bottom - box[3]) / (FEET * tall + PIXELS)
    if feet > 0:
        feet /= EARLY_FEET
    return float(0.5 * (middle * middle + wide * wide + head * head + feet * feet))


@kernel
def fill_match(bodies: Floats, boxes: Floats, belief: Floats, width: float, height: float, match: Floats) -> None:
    """Fill match (candidate, box): log-likelihood of each box (n, 4) given each pillar's box (candidate, 4)."""
    for i in range(len(bodies)):
        for b in range(len(boxes)):
            match[i, b] = -np.inf
            if not np.isnan(bodies[i, 0]):
                match[i, b] = belief[b] - half_square(bodies[i], boxes[b], width, height)


@kernel
def fill_best_match(bodies: Floats, boxes: Floats, belief: Floats, width: float, height: float, best: Floats) -> None:
    """Fill best (height, cell) with the best log-likelihood over all boxes; -inf where none fits."""
    for h in range(bodies.shape[0]):
        for i in range(bodies.shape[1]):
            best[h, i] = -np.inf
            if not np.isnan(bodies[h, i, 0]):
                for b in range(len(boxes)):
                    fit = belief[b] - half_square(bodies[h, i], boxes[b], width, height)
                    best[h, i] = max(best[h, i], fit)


@kernel
def fill_inside(bodies: Floats, width: float, height: float, inside: Floats) -> None:
    """Fill inside (candidate,): the share of each pillar's box (candidate, 4) that lies in the image."""
    for i in range(len(bodies)):
        inside[i] = 0.0
        if not np.isnan(bodies[i, 0]):
            wide = min(bodies[i, 2], width) - max(bodies[i, 0], 0.0)
            tall = min(bodies[i, 3], height) - max(bodies[i, 1], 0.0)
            whole = (bodies[i, 2] - bodies[i, 0]) * (bodies[i, 3] - bodies[i, 1])
            inside[i] = max(wide, 0.0) * max(tall, 0.0) / whole


@kernel
def fill_cover(bodies: Floats, distance: Floats, width: float, height: float, cover: Floats) -> None:
    """Fill cover (candidate, candidate): share of the first's box, clipped to the image, behind the second's trunk."""
    for i in range(len(bodies)):
        left, right = max(bodies[i, 0], 0.0), min(bodies[i, 2], width)
        top, bottom = max(bodies[i, 1], 0.0), min(bodies[i, 3], height)
        area = max(right - left, 0.0) * max(bottom - top, 0.0)
        for k in range(len(bodies)):
            cover[i, k] = 0.0
            if not (area > 0 and distance[k] < distance[i] - 0.1 and not np.isnan(bodies[k, 0])):
                continue
            inset = 0.1 * (bodies[k, 2] - bodies[k, 0])
            wide = min(right, bodies[k, 2] - inset) - max(left, bodies[k, 0] + inset)
            tall = min(bottom, bodies[k, 3]) - max(top, bodies[k, 1])
            if wide > 0 and tall > 0:
                cover[i, k] = min(wide * tall / area, 1.0)
