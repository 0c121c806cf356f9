"""Assignment of foreground pixels to people, given a hypothesis of their places (Kim and Davis 2006, eqs 2, 4).

    P(k | x) = P(k) P(x | k) / P(x),   P(k) = O_k(x) prod over l nearer to the camera of (1 - O_l(x))   (eqs 2 and 4)

P(x | k) is eq. 1 of the body part that x would be of k. An unassigned pixel has probability prod over all l of
(1 - O_l(x)) and any colour; the paper excludes such pixels by a threshold.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Floats, Ints, Labels, Singles
from stseg.baselines.kim_davis_2006.bodies import occupancy, part_at, placed
from stseg.kernels.accelerate import kernel

NO_PERSON = -1


class Canvas(NamedTuple):
    """Buffers for the segmentation of one view; only boxes around people are kept up to date."""

    label: Labels
    """int32 (v, u): the likeliest person, NO_PERSON for none."""
    best: Singles
    total: Singles
    """float32 (v, u) each: p(k) P(x | k) of that person, and the sum over all people."""
    free: Singles
    """float32 (v, u): probability that no person processed so far covers the pixel."""

    @classmethod
    def of(cls, rows: int, columns: int) -> Canvas:
        """An empty canvas."""
        shape = rows, columns
        return cls(np.full(shape, NO_PERSON, np.int32), *(np.zeros(shape, np.float32) for _ in range(3)))


@kernel
def clear(boxes: Ints, canvas: Canvas) -> None:
    """Assign every pixel to background."""
    for k in range(len(boxes)):
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                canvas.label[v, u], canvas.best[v, u], canvas.total[v, u], canvas.free[v, u] = NO_PERSON, 0.0, 0.0, 1.0


@kernel
def segment(
    bodies: Floats,
    order: Ints,
    boxes: Ints,
    ideal: Singles,
    foreground: Bytes,
    density: Singles,
    half_width: Floats,
    parts: Floats,
    canvas: Canvas,
) -> None:
    """Label a view's foreground.

    Parameters
    ----------
    bodies : float64 (n, 5), order : int64 (n,)
        See `bodies.fill_bodies`; and the people from the nearest to the farthest.
    boxes : int64 (n, 4)
        Pixels that each person may cover, see `bodies.fill_boxes`.
    ideal : float32 (v, u, 2)
        Undistorted coordinates of each pixel.
    foreground : uint8 (v, u)
        Not 0 for foreground.
    density : float32 (n, part, v, u)
        Eq. 1 of each person's parts.
    half_width, parts
        HALF_WIDTH and PARTS.
    """
    clear(boxes, canvas)
    for k in order:
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                if foreground[v, u]:
                    along, across = placed(bodies[k], ideal[v, u, 0], ideal[v, u, 1])
                    covered = occupancy(along, across, half_width)
                    likely = canvas.free[v, u] * covered * density[k, part_at(along, parts), v, u]
                    canvas.total[v, u] += likely
                    if likely > canvas.best[v, u]:
                        canvas.best[v, u], canvas.label[v, u] = likely, k
                    canvas.free[v, u] *= 1.0 - covered
    for k in order:
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                if canvas.free[v, u] > canvas.best[v, u]:
                    canvas.label[v, u] = NO_PERSON


@kernel
def fill_unoccluded(
    bodies: Floats,
    order: Ints,
    boxes: Ints,
    ideal: Singles,
    half_width: Floats,
    parts: Floats,
    free: Singles,
    owner: Labels,
    unoccluded: Ints,
) -> None:
    """Mark the unoccluded pixels of people, from which colour models may be learned.

    Parameters
    ----------
    free : float32 (v, u)
        Scratch buffer.
    owner : int32 (v, u)
        Filled within the boxes with the number of parts times the person, plus the part, or NO_PERSON.
    unoccluded : int64 (n,)
        Filled with the number of pixels that each person covers and no nearer person does.
    """
    for k in range(len(boxes)):
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                free[v, u], owner[v, u] = 1.0, NO_PERSON
    for k in order:
        unoccluded[k] = 0
        for v in range(boxes[k, 0], boxes[k, 1]):
            for u in range(boxes[k, 2], boxes[k, 3]):
                along, across = placed(bodies[k], ideal[v, u, 0], ideal[v, u, 1])
                covered = occupancy(along, across, half_width)
                if covered * free[v, u] > 0.5:
                    unoccluded[k] += 1
                if covered > 0.7 and free[v, u] > 0.9:
                    owner[v, u] = k * len(parts) + part_at(along, parts)
                free[v, u] *= 1.0 - covered
