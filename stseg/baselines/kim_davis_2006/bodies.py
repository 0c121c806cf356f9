"""Projection of a body into a view, and its coverage probability of a pixel (Kim and Davis 2006, eq. 3).

A body's axis runs from the pixel of its feet to that of its head. A pixel x lies at the height h along it and at the
distance w from it, both relative to the axis's length, and is covered with

    O(h, w) = P[w < W(h)] = 1 - cdf_W(h)(w),          (Kim and Davis 2006, equation 3)

one half at the distance W(h) of the body's outline. The distance W is logistic, and above the head and below the feet
the body ends as it does at its sides.
"""

import math

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.bodies.pillars import PROFILE
from stseg.geometry.rig import BODY_HEIGHT
from stseg.kernels.accelerate import kernel, part

PARTS = np.array([0.47, 0.84, 10.0])
"""Where legs, trunk and head end, relative to the height."""
_LEVELS = 32
HALF_WIDTH = np.interp((np.arange(_LEVELS) + 0.5) / _LEVELS, PROFILE[:, 0], PROFILE[:, 1] / BODY_HEIGHT)
"""W by relative height, float64 (level,)."""
LOOSENESS = 0.025
"""Scale of the logistic distribution of W: clothes, strides, and the error of a foreground's edge."""
MARGIN = 6 * LOOSENESS + float(HALF_WIDTH.max())
"""Greatest distance of a body pixel from the axis, relative to its length."""


@part
def placed(body: Floats, u: float, v: float) -> tuple[float, float]:
    """h and w of a pixel in the body's frame."""
    offset_u, offset_v = u - body[0], v - body[1]
    length = body[2] * body[2] + body[3] * body[3]
    along = (offset_u * body[2] + offset_v * body[3]) / length
    return along, abs(offset_u * body[3] - offset_v * body[2]) / length


@part
def occupancy(along: float, across: float, half_width: Floats) -> float:
    """O(h, w) of eq. 3, 0..1."""
    level = min(max(along, 0.0), 1.0)
    overshoot = along - level
    if overshoot != 0.0:
        across = math.sqrt(across * across + overshoot * overshoot)
    width = half_width[min(int(level * len(half_width)), len(half_width) - 1)]
    return 1.0 / (1.0 + math.exp(min((across - width) / LOOSENESS, 30.0)))


@part
def part_at(along: float, parts: Floats) -> int:
    """The body part at a relative height."""
    if along < parts[0]:
        return 0
    return 1 if along < parts[1] else 2


@kernel
def fill_bodies(projection: Floats, centre: Floats, ground: Floats, height: Floats, bodies: Floats) -> None:
    """Fill bodies (n, 5): u and v of the feet, the vector to the head, undistorted pixels, and the distance, metres.

    A person behind the camera has a distance of inf and no extent.
    """
    for k in range(len(ground)):
        x, y = ground[k, 0], ground[k, 1]
        feet = projection[:, 0] * x + projection[:, 1] * y + projection[:, 3]
        head = feet + projection[:, 2] * height[k]
        bodies[k, :4], bodies[k, 4] = 0.0, np.inf
        if feet[2] > 0.0 and head[2] > 0.0:
            bodies[k, 0], bodies[k, 1] = feet[0] / feet[2], feet[1] / feet[2]
            bodies[k, 2], bodies[k, 3] = head[0] / head[2] - bodies[k, 0], head[1] / head[2] - bodies[k, 1]
            bodies[k, 4] = math.sqrt((x - centre[0]) ** 2 + (y - centre[1]) ** 2)


@kernel
def fill_boxes(ideal: Singles, bodies: Floats, margin: Floats, boxes: Ints) -> None:
    """Fill boxes (n, 4), the rows and columns (each first, stop) whose pixels come near each body; empty if none.

    Parameters
    ----------
    ideal : float32 (v, u, 2)
        Undistorted coordinates of each pixel of the raster.
    margin : float64 (n,)
        Search margin beyond MARGIN, relative to the body's length.
    """
    for k in range(len(bodies)):
        boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3] = ideal.shape[0], 0, ideal.shape[1], 0
        if not math.isfinite(bodies[k, 4]):
            continue
        for v in range(ideal.shape[0]):
            for u in range(ideal.shape[1]):
                along, across = placed(bodies[k], ideal[v, u, 0], ideal[v, u, 1])
                if across < MARGIN + margin[k] and -MARGIN - margin[k] < along < 1.0 + MARGIN + margin[k]:
                    boxes[k, 0], boxes[k, 1] = min(boxes[k, 0], v), max(boxes[k, 1], v + 1)
                    boxes[k, 2], boxes[k, 3] = min(boxes[k, 2], u), max(boxes[k, 3], u + 1)
