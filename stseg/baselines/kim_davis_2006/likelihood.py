"""Colour likelihood of a particle (Kim and Davis 2006, eqs 6, 7).

    d^2 = 1 - sum_u sqrt(q*_r(u) q_r(u)),     log pi = sum over people, views and parts r of  -lambda d^2     (eq. 7)

q_r is the histogram (eq. 6) of the pixels that the part covers and no nearer person does, P(k) > 1/2: ground pixels
among them fit badly, so a particle beside the person weighs little. A part that is occluded or outside the image has no
histogram. The paper leaves it out, which favours particles in which a person is occluded; here its d^2 is NEUTRAL, a
typical distance between different people.
"""

import math

from stseg.arrays import Floats, Ints, Labels, Singles
from stseg.baselines.kim_davis_2006.bodies import occupancy, part_at, placed
from stseg.kernels.accelerate import kernel

NEUTRAL = 0.25
"""d^2 of an occluded part."""


@kernel
def add_misfit(
    bodies: Floats,
    order: Ints,
    boxes: Ints,
    ideal: Singles,
    bins: Labels,
    reference: Floats,
    areas: Floats,
    half_width: Floats,
    parts: Floats,
    free: Singles,
    counts: Floats,
    misfit: Floats,
) -> None:
    """Add each person's sum over the parts of d^2 in one view to misfit float64 (n,).

    Parameters
    ----------
    bodies, order, boxes, ideal
        As in `segmentation.segment`.
    bins : int32 (v, u)
        The histogram bin of each pixel.
    reference : float64 (n, part, bin)
        q*; all 0 for a part without a colour model.
    areas : float64 (part,)
        Pixels of the raster that each part covers, relative to the square of the body's length in pixels.
    half_width, parts
        HALF_WIDTH and PARTS.
    free : float32 (v, u), counts : float64 (part, bin)
        Scratch buffers.
    """
    for k in order:
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                free[v, u] = 1.0
    for k in order:
        counts[:] = 0.0
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                along, across = placed(bodies[k], ideal[v, u, 0], ideal[v, u, 1])
                covered = occupancy(along, across, half_width)
                if free[v, u] * covered > 0.5:
                    counts[part_at(along, parts), bins[v, u]] += 1.0
                free[v, u] *= 1.0 - covered
        length = bodies[k, 2] ** 2 + bodies[k, 3] ** 2
        for r in range(len(areas)):
            counted, coefficient, learned = 0.0, 0.0, 0.0
            for b in range(counts.shape[1]):
                counted += counts[r, b]
                learned += reference[k, r, b]
                coefficient += math.sqrt(counts[r, b] * reference[k, r, b])
            share = 0.0
            if counted > 0.0 and learned > 0.0:
                coefficient /= math.sqrt(counted)
                share = min(counted / max(areas[r] * length, 1.0), 1.0)
            misfit[k] += share * (1.0 - coefficient) + (1.0 - share) * NEUTRAL
