"""Pillars of a view in the order of their image columns, so that a box meets only those that it may fit.

A box fits a pillar only if their middles are within `MATCH_LIMIT` tolerances of each other, and tolerances are shares
of the pillar's height in the image. So pillars are sorted by classes of that height, and within a class by the column
of their middle: the pillars that a box may fit are one run of each class.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Floats, Ints, Labels, Singles
from stseg.bodies.box_fit import (
    EDGE_GRAIN,
    FEET_LIMIT,
    LEAST_PIXEL_HEIGHT,
    LOWER_EDGE,
    MATCH_LIMIT,
    MIDDLE_OFFSET,
    UPPER_EDGE,
    ViewBoxes,
    half_square,
)
from stseg.kernels.accelerate import kernel, part

_CLASSES = 2.0
"""Classes of height to a factor of two."""


class PillarIndex(NamedTuple):
    """Sorted pillars of one view; pillars outside the image are left out."""

    order: Labels
    """int32 (k,): numbers of the pillars, by class, then by column."""
    middle: Floats
    top: Floats
    bottom: Floats
    """float64 (k,) each: column of the middle of each, and rows of its edges, clipped to the image, pixels."""
    start: Ints
    """int64 (class + 1,): first of each class in `order`."""
    tallest: Floats
    """float64 (class,): height of the tallest pillar of each class, pixels."""

    @classmethod
    def of(cls, bodies: Floats | Singles, size: tuple[int, int]) -> Self:
        """The index of pillars' boxes (n, 4), left, top, right, bottom in pixels, in images of a size."""
        edges = np.asarray(bodies, float).reshape(-1, 4)
        left, right = (edges[:, k].clip(0, size[0] - 1) for k in (0, 2))
        top, bottom = (edges[:, k].clip(0, size[1] - 1) for k in (1, 3))
        inside = (right > left) & (bottom > top)
        tall = np.maximum(edges[:, 3] - edges[:, 1], LEAST_PIXEL_HEIGHT)
        middle = (left + right) / 2
        kind = np.floor(_CLASSES * np.log2(np.where(inside, tall, LEAST_PIXEL_HEIGHT)))
        order = np.lexsort((middle, kind))
        order = order[inside[order]]
        starts = np.flatnonzero(np.diff(kind[order], prepend=-1.0))
        tallest = np.maximum.reduceat(tall[order], starts) if len(order) else np.zeros(0)
        start = np.append(starts, len(order)).astype(np.int64)
        return cls(order.astype(np.int32), middle[order], top[order], bottom[order], start, tallest)


@part
def _reach(quantity: int, tall: float, tolerance: Floats, deviations: float) -> float:
    """Greatest offset of a box in one quantity from a pillar that it fits within so many tolerances, pixels."""
    return float(deviations * tolerance[quantity] * (tall + EDGE_GRAIN[quantity]) + 1e-3)


@part
def pillar_range(index: PillarIndex, kind: int, box: Floats, tolerance: Floats, deviations: float) -> tuple[int, int]:
    """First and stop in `index.order` of the pillars of a class that a box may fit within so many tolerances.

    Parameters
    ----------
    box : float64 (4,)
        left, top, right, bottom, pixels, within the image.
    tolerance : float64 (5,)
        See `stseg.bodies.box_fit`.
    """
    place = (box[0] + box[2]) / 2
    reach = _reach(MIDDLE_OFFSET, index.tallest[kind], tolerance, deviations)
    middle = index.middle[index.start[kind] : index.start[kind + 1]]
    first = np.searchsorted(middle, place - reach)
    stop = np.searchsorted(middle, place + reach, side="right")
    return index.start[kind] + first, index.start[kind] + stop


@kernel
def fill_fits(
    index: PillarIndex, bodies: Floats | Singles, boxes: ViewBoxes, b: int, least: float, pillar: Labels, fit: Floats
) -> int:
    """Fill pillar (k,) and fit (k,) with the pillars of which box b has a log-likelihood above `least`, and with that.

    `bodies` float (pillar, 4) are left, top, right, bottom, pixels. Returned is the number of these pillars.
    """
    box, tolerance, belief = boxes.edges[b], boxes.tolerance[b], boxes.belief[b]
    spare, number = belief - least, 0
    if spare <= 0.0:
        return 0
    deviations = math.sqrt(2.0 * spare)
    top, bottom = box[1], box[3]
    may_hide = deviations * tolerance[LOWER_EDGE] > tolerance[FEET_LIMIT]
    for kind in range(len(index.tallest)):
        tall = index.tallest[kind]
        head = _reach(UPPER_EDGE, tall, tolerance, deviations)
        late = _reach(LOWER_EDGE, tall, tolerance, deviations)
        if tall + head + late < bottom - top:
            continue
        early = np.inf if may_hide else late
        first, stop = pillar_range(index, kind, box, tolerance, min(MATCH_LIMIT, deviations))
        for k in range(np.uint64(first), np.uint64(stop)):  # most pillars are decided by their edges
            if abs(index.top[k] - top) > head or not -late <= index.bottom[k] - bottom <= early:
                continue
            i = index.order[k]
            likelihood = belief - half_square(bodies[i], box, tolerance, boxes.width, boxes.height)
            if likelihood > least:
                pillar[number], fit[number] = i, likelihood
                number += 1
    return number
