"""Label placement with little overlap between labels and line ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stseg.arrays import AnyArray, Floats

_DIRECTIONS = np.array([(1, -1), (-1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (-1, 0), (0, 1)], float)


def place_labels(
    points: AnyArray, sizes: Sequence[tuple[int, int]], bounds: tuple[float, float, float, float], gap: float = 9.0
) -> Floats:
    """Place labels beside their points greedily, in the given order.

    Parameters
    ----------
    points : float64 (n, 2)
        Labelled points, pixels.
    sizes
        Width and height of each label, pixels.
    bounds
        left, top, right, bottom of the canvas, pixels.
    gap
        Distance from a point to its label, pixels.

    Returns
    -------
    float64 (n, 2)
    """
    points = np.asarray(points, float).reshape(-1, 2)
    occupied = np.concatenate([points - 5, points + 5], axis=1)
    centres = np.zeros_like(points)
    for k, (point, size) in enumerate(zip(points, sizes, strict=True)):
        half = np.array(size, float) / 2
        offered = point + _DIRECTIONS * (half + gap * np.where(_DIRECTIONS.all(axis=1), 0.5, 1.0)[:, None])
        offered = np.clip(offered, np.array(bounds[:2]) + half, np.array(bounds[2:]) - half)
        boxes = np.concatenate([offered - half, offered + half], axis=1)
        best = int(np.argmin(_overlap(boxes, occupied)))
        centres[k] = offered[best]
        occupied = np.concatenate([occupied, boxes[best : best + 1]])
    return centres


def _overlap(boxes: Floats, occupied: Floats) -> Floats:
    """Occupied area of each box, square pixels, float64 (n,)."""
    low = np.maximum(boxes[:, None, :2], occupied[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], occupied[None, :, 2:])
    return np.asarray(np.prod(np.clip(high - low, 0, None), axis=-1).sum(axis=1))
