"""Masks of detections: polygons, and run lengths as COCO encodes them.

Source of the compressed form: the COCO API (cocodataset/cocoapi, maskApi.c): counts of alternating zeros and ones down
the columns, from the fourth on as differences to the count two before, six bits a character.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stseg.arrays import Bytes, Floats, Ints
from stseg.io.untrusted import limits

_LONGEST_SHIFT = 40
"""Bits of a run length."""


@dataclass(frozen=True)
class Polygons:
    """Outlines, each float64 (k, 2), u and v in pixels; the mask is their union."""

    outlines: tuple[Floats, ...]

    def draw(self, size: tuple[int, int]) -> Bytes:
        """The mask as an image of a width and height, uint8 (v, u), 0 or 1."""
        image = np.zeros(size[::-1], np.uint8)
        for outline in self.outlines:
            cv2.fillPoly(image, [np.rint(outline).astype(np.int32)], 1)
        return image

    def box(self) -> tuple[float, float, float, float]:
        """left, top, width, height."""
        points = np.concatenate(self.outlines)
        low, high = points.min(axis=0), points.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])


@dataclass(frozen=True)
class RunLengths:
    """Counts of alternating zeros and ones of an image of `size` (width, height), down its columns."""

    size: tuple[int, int]
    counts: Ints

    def draw(self, size: tuple[int, int]) -> Bytes:
        """The mask as an image, uint8 (v, u), 0 or 1, resized where it was made at another size."""
        values = np.arange(len(self.counts)) % 2
        image = np.repeat(values, self.counts).astype(np.uint8).reshape(self.size).T
        if self.size == size:
            return np.ascontiguousarray(image)
        return np.asarray(cv2.resize(np.ascontiguousarray(image), size, interpolation=cv2.INTER_NEAREST))

    def box(self) -> tuple[float, float, float, float]:
        """left, top, width, height; zeros where nothing is set."""
        stop, height = np.cumsum(self.counts)[1::2], self.size[1]
        start = stop - self.counts[1::2]
        start, stop = start[start < stop], stop[start < stop]
        if not len(start):
            return 0.0, 0.0, 0.0, 0.0
        first, last = start // height, (stop - 1) // height
        within = first == last  # a run over several columns reaches their upper and lower ends
        top = int(np.where(within, start % height, 0).min())
        bottom = int(np.where(within, (stop - 1) % height, height - 1).max())
        return float(first[0]), float(top), float(last[-1] - first[0] + 1), float(bottom - top + 1)


Mask = Polygons | RunLengths


def flat_polygons(flat: Sequence[Sequence[float]]) -> Polygons:
    """Polygons from flat lists u, v, u, v, ...; raises ValueError where one is none."""
    return polygons([np.array(one, float).reshape(-1, 2) for one in flat])


def polygons(outlines: Sequence[Floats]) -> Polygons:
    """Polygons from outlines (k, 2); raises ValueError where one is none."""
    if not outlines or any(len(outline) < 3 for outline in outlines):
        raise ValueError("a polygon of fewer than 3 points")
    points = np.concatenate([np.asarray(outline, float) for outline in outlines])
    if not (np.abs(points) <= limits.SIDE * 4).all():
        raise ValueError("a polygon far beyond any image")
    return Polygons(tuple(np.asarray(outline, float) for outline in outlines))


def run_lengths(size: Sequence[int], counts: str | Sequence[int]) -> RunLengths:
    """A mask from COCO's `size` (height, width) and `counts`; raises ValueError where they do not fit together."""
    height, width = (int(side) for side in size)
    if not (0 < height <= limits.SIDE and 0 < width <= limits.SIDE and height * width <= limits.PIXELS):
        raise ValueError(f"run lengths of an image of {width} x {height}")
    decoded = _decoded(counts) if isinstance(counts, str) else np.array(counts, np.int64).reshape(-1)
    if (decoded < 0).any() or int(decoded.sum()) != height * width:
        raise ValueError(f"run lengths of {int(decoded.sum())} pixels for an image of {width} x {height}")
    return RunLengths((width, height), decoded)


def _decoded(text: str) -> Ints:
    counts: list[int] = []
    value = shift = 0
    for character in text:
        bits = ord(character) - 48
        if not 0 <= bits < 64:
            raise ValueError("run lengths that are not COCO's")
        if shift > _LONGEST_SHIFT:
            raise ValueError("a run length of more digits than an image has pixels")
        value |= (bits & 0x1F) << shift
        shift += 5
        if bits & 0x20:
            continue
        if bits & 0x10:
            value |= -1 << shift
        counts.append(value + (counts[-2] if len(counts) > 2 else 0))
        value = shift = 0
    if shift:
        raise ValueError("run lengths that end within a number")
    return np.array(counts, np.int64)
