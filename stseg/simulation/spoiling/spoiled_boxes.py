"""Errors of a detector's boxes: inexact edges, missed and doubled boxes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stseg.arrays import Boxes

_DOUBLE_SPREAD = 0.25
"""Standard deviation of the edges of a box's double, share of its size."""


def _jitter(boxes: Boxes, share: float, rng: np.random.Generator) -> Boxes:
    """Edges moved by normal errors, shares of the box's size."""
    corner, size = boxes.pixel[:, :2], boxes.pixel[:, 2:]
    first = corner + rng.normal(0.0, share, corner.shape) * size
    last = corner + size + rng.normal(0.0, share, corner.shape) * size
    return Boxes(np.concatenate([first, np.maximum(last - first, 1.0)], 1), boxes.score)


def _missed(boxes: Boxes, share: float, rng: np.random.Generator) -> Boxes:
    kept = rng.uniform(size=len(boxes)) >= share
    return boxes.of(kept)


def _doubled(boxes: Boxes, share: float, rng: np.random.Generator) -> Boxes:
    """A share of the boxes with an inexact double of lower score."""
    chosen = rng.uniform(size=len(boxes)) < share
    twins = _jitter(Boxes(boxes.pixel[chosen], 0.8 * boxes.score[chosen]), _DOUBLE_SPREAD, rng)
    return Boxes(np.concatenate([boxes.pixel, twins.pixel]), np.concatenate([boxes.score, twins.score]))


BOX_KINDS: dict[str, Callable[[Boxes, float, np.random.Generator], Boxes]] = {
    "jitter": _jitter,
    "missed": _missed,
    "doubled": _doubled,
}
"""Each takes a view's boxes, a strength and a random stream."""
