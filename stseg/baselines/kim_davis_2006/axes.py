"""Central vertical axes of segmented people, and their intersection on the ground (Kim and Davis 2006, eq. 5).

A person's pixels lie on both sides of the image of the vertical through their ground point. The paper fits a free line
to them. Here the direction is known: all verticals of a view meet in its vertical vanishing point
(docs/how-it-works.md, Geometry). What is left is the offset, from the distances of the pixels from a line of that
direction: their mean (least squares), or the middle of the shortest interval that holds half of them (the least
median of squares of one parameter), which ignores an arm or unassigned pixels.

The axes of all views, mapped to the ground as lines a x + b y + c = 0 with a^2 + b^2 = 1, intersect at

    argmin over (x, y)  sum_i  w_i^2 (a_i x + b_i y + c_i)^2      (Kim and Davis 2006, equation 5)

with w_i the sum of the posterior probabilities of the segmented pixels, relative to the body's area.
"""

import math

import numpy as np

from stseg.arrays import Floats, Ints, Singles
from stseg.baselines.kim_davis_2006.segmentation import Canvas
from stseg.kernels.accelerate import kernel

HYPOTHESIS_WEIGHT = 0.15
"""Weight w of the hypothesis itself in eq. 5: a prior where nothing is segmented, and along parallel axes."""


@kernel
def fill_axes(
    bodies: Floats,
    boxes: Ints,
    ideal: Singles,
    canvas: Canvas,
    step: float,
    widths: float,
    ground: Floats,
    vertical: Floats,
    median: bool,
    distances: Floats,
    axes: Floats,
) -> None:
    """The axes of all people in a view.

    Parameters
    ----------
    bodies, boxes, ideal, canvas
        Arguments of `segmentation.segment`, after the call.
    step
        Pixels of the image to a pixel of the raster.
    widths
        Mean width of a body, relative to its length.
    ground, vertical
        The camera's homography and vertical.
    median
        Least median of squares; else least squares.
    distances : float64 (v * u,)
        Scratch buffer.
    axes : float64 (n, 4)
        Filled with a, b and c of the axis on the ground, and w; all 0 where nothing is segmented.
    """
    for k in range(len(bodies)):
        axes[k] = 0.0
        mass, mean_u, mean_v, count = 0.0, 0.0, 0.0, 0
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                if canvas.label[v, u] == k:
                    probability = canvas.best[v, u] / (canvas.total[v, u] + canvas.free[v, u])
                    mass += probability
                    mean_u += probability * ideal[v, u, 0]
                    mean_v += probability * ideal[v, u, 1]
                    count += 1
        if count < 3:
            continue
        mean_u, mean_v = mean_u / mass, mean_v / mass
        direction_u, direction_v = vertical[0] - vertical[2] * mean_u, vertical[1] - vertical[2] * mean_v
        length = math.hypot(direction_u, direction_v)
        if length == 0.0:
            continue
        direction_u, direction_v = direction_u / length, direction_v / length
        if median:
            n = 0
            for v in range(boxes[k, 0], boxes[k, 1]):
                for u in range(boxes[k, 2], boxes[k, 3]):
                    if canvas.label[v, u] == k:
                        distances[n] = (ideal[v, u, 0] - mean_u) * direction_v - (ideal[v, u, 1] - mean_v) * direction_u
                        n += 1
            shift = _middle_of_shortest_half(distances[:n])
            mean_u, mean_v = mean_u + shift * direction_v, mean_v - shift * direction_u
        # The image line through the mean along the vertical, mapped to the ground by the transposed homography.
        line_a, line_b = direction_v, -direction_u
        line_c = -(line_a * mean_u + line_b * mean_v)
        a = ground[0, 0] * line_a + ground[1, 0] * line_b + ground[2, 0] * line_c
        b = ground[0, 1] * line_a + ground[1, 1] * line_b + ground[2, 1] * line_c
        c = ground[0, 2] * line_a + ground[1, 2] * line_b + ground[2, 2] * line_c
        scale = math.hypot(a, b)
        area = widths * (bodies[k, 2] ** 2 + bodies[k, 3] ** 2) / step**2
        if scale > 0.0 and area > 0.0:
            axes[k, 0], axes[k, 1], axes[k, 2] = a / scale, b / scale, c / scale
            axes[k, 3] = min(mass / area, 1.0)


@kernel
def _middle_of_shortest_half(distances: Floats) -> float:
    """The middle of the shortest interval that holds half of the distances; sorts them."""
    distances.sort()
    n = len(distances)
    half = n // 2 + 1
    best, middle = np.inf, 0.0
    for first in range(n - half + 1):
        extent = distances[first + half - 1] - distances[first]
        if extent < best:
            best, middle = extent, 0.5 * (distances[first + half - 1] + distances[first])
    return middle


@kernel
def intersect_axes(axes: Floats, hypothesis_weight: float, ground: Floats) -> float:
    """Move people (n, 2) to the intersection of their axes (view, n, 4); returns the largest shift, metres."""
    farthest = 0.0
    for k in range(len(ground)):
        xx, xy, yy = hypothesis_weight * hypothesis_weight, 0.0, hypothesis_weight * hypothesis_weight
        x, y = xx * ground[k, 0], yy * ground[k, 1]
        for view in range(len(axes)):
            a, b, c, w = axes[view, k, 0], axes[view, k, 1], axes[view, k, 2], axes[view, k, 3]
            xx, xy, yy = xx + w * w * a * a, xy + w * w * a * b, yy + w * w * b * b
            x, y = x - w * w * a * c, y - w * w * b * c
        determinant = xx * yy - xy * xy
        new_x, new_y = (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant
        farthest = max(farthest, math.hypot(new_x - ground[k, 0], new_y - ground[k, 1]))
        ground[k, 0], ground[k, 1] = new_x, new_y
    return farthest
