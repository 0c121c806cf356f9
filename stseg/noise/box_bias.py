"""Mean errors of boxes, by which they are corrected before they are observed.

Two errors last through all frames. Boxes end below the feet or above them, by a share m of the body's height that is
the same in all views. And a view of which pose, focal length or lens are not exact shows people beside the places where
the others see them: its boxes stand

    s = W (b_0 + b_1 u + b_2 v)

pixels too far to the left, in an image of width W, with u and v of the box's middle from -1 to 1 across the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AlignedBoxes, Boxes, Flags, Floats, ViewEvidence
from stseg.bodies.box_fit import EDGE_GRAIN, LOWER_EDGE

SHIFT_TERMS = 3
"""Number of terms of a shift: b_0, b_1, b_2."""


@dataclass(frozen=True)
class BoxBias:
    """Mean errors of the boxes of all views."""

    lower_edge: float
    """m, below 0 where boxes end below the feet."""
    shift: Floats
    """float64 (view, 3): b of each view."""

    def corrected(self, evidence: Sequence[ViewEvidence], sizes: Sequence[tuple[int, int]]) -> list[ViewEvidence]:
        """Evidence in images of sizes (width, height), with boxes that end at the feet and stand at their people."""
        triples = zip(evidence, self.shift, sizes, strict=True)
        return [self._corrected(v, shift, size) if isinstance(v, Boxes) else v for v, shift, size in triples]

    def _corrected(self, boxes: Boxes, shift: Floats, size: tuple[int, int]) -> AlignedBoxes:
        edges, tall = boxes.pixel.copy(), boxes.pixel[:, 3]
        edges[:, 2:] += edges[:, :2]
        moved = np.maximum(tall + self.lower_edge * (tall + EDGE_GRAIN[LOWER_EDGE]), 1.0)
        height = np.where(whole_boxes(edges, size), moved, tall)
        sides = (edges[:, 0] > 0) & (edges[:, 2] < size[0] - 1)
        right = np.where(sides, shift_terms(edges, size) @ shift, 0.0)
        pixel = np.column_stack([boxes.pixel[:, 0] + right, boxes.pixel[:, 1:3], height])
        return AlignedBoxes(pixel, boxes.score, boxes.features, right)


def shift_terms(edges: Floats, size: tuple[int, int]) -> Floats:
    """Shift of boxes, edges (n, 4) in an image (width, height), by one of each term, pixels, float64 (n, 3)."""
    middle = (edges[:, :2] + edges[:, 2:]) / np.array(size) - 1.0
    return size[0] * np.column_stack([np.ones(len(edges)), middle])


def whole_boxes(edges: Floats, size: tuple[int, int]) -> Flags:
    """Boxes float64 (n, 4) of edges that the border of an image (width, height) does not cut."""
    return np.asarray((edges[:, :2] > 0).all(1) & (edges[:, 2:] < np.array(size) - 1).all(1))
