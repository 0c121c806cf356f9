"""Footprints: the pixels of each view that show each cell, computed once.

A cell covers many pixels of a near view and a part of one of a far view. Its *footprint* is the axis-aligned box of
pixels about its centre with the spread of its image: a square of side c that J (the Jacobian of ground metres to
pixels, lens included) takes into the image has the covariance c^2 J J^T / 12, so the box of the same variances is

    c |dU/d(x, y)| pixels wide and c |dV/d(x, y)| pixels high,

at least one pixel each way. Point sampling is the footprint of one pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Flags, Floats, Singles
from stseg.geometry import Camera, Rig
from stseg.geometry.summed_area import LARGEST_SIDE

SamplingKind = Literal["footprint", "point"]
Footprints = NDArray[np.int16]
"""int16 (..., 4): left, top, width and height in pixels; all 0 where the view does not see the cell."""

_STEP = 1e-3
"""Of a cell's side, over which derivatives are taken."""


@dataclass(frozen=True)
class Sampling:
    """Look-up tables of a rig.

    Attributes
    ----------
    footprint : int16 (view, plane, y, x, 4)
        The pixels that show each cell; width 0 where the view does not see it, or it lies outside the area.
    distance : float32 (view, y, x)
        Distance of the cell from the camera along the ground, metres.
    """

    footprint: Footprints
    distance: Singles

    @classmethod
    def of(cls, rig: Rig, kind: SamplingKind) -> Sampling:
        """The tables of `rig`, lenses and the polygon of the area included."""
        footprint = np.stack([_footprints(camera, rig, kind) for camera in rig.cameras])
        ground = rig.grid.ground
        away = [np.hypot(*np.moveaxis(ground - camera.centre[:2], -1, 0)) for camera in rig.cameras]
        return cls(footprint, np.stack(away).astype(np.float32))

    def views(self) -> Bytes:
        """Number of views that see each cell, uint8 (plane, y, x)."""
        return np.asarray((self.footprint[..., 2] > 0).sum(0), np.uint8)

    def regions(self) -> list[tuple[slice, slice]]:
        """Rows and columns of each view that footprints cover; empty slices where the view sees no cell."""
        return [(_span(boxes[..., 1], boxes[..., 3]), _span(boxes[..., 0], boxes[..., 2])) for boxes in self.footprint]


def _span(first: NDArray[np.int16], extent: NDArray[np.int16]) -> slice:
    seen = extent > 0
    start = int(first[seen].min(initial=32767))
    return slice(start, max(start, int((first + extent)[seen].max(initial=0))))


def _footprints(camera: Camera, rig: Rig, kind: SamplingKind) -> Footprints:
    footprint = np.zeros((*rig.grid.shape, 4), np.int16)
    for plane, height in enumerate(rig.grid.heights):
        centre, ahead = camera.project(rig.grid.ground, float(height))
        seen = ahead & camera.inside(centre) & rig.grid.inside()
        extent = np.ones_like(centre)
        if kind == "footprint":
            extent = _extent(camera, rig, float(height), seen)
        footprint[plane][seen] = _boxes(centre[seen], extent[seen], camera.size)
    return footprint


def _extent(camera: Camera, rig: Rig, height: float, seen: Flags) -> Floats:
    """Width and height of the cells' images, pixels, float64 (y, x, 2); 1 where a derivative is not to be had."""
    cell, ground = rig.grid.cell, rig.grid.ground
    square = np.zeros((*ground.shape[:2], 2))
    for axis in np.eye(2) * _STEP * cell / 2:
        (before, _), (behind, _) = camera.project(ground + axis, height), camera.project(ground - axis, height)
        square[seen] += ((before - behind)[seen] / _STEP) ** 2
    return np.asarray(np.nan_to_num(np.sqrt(square), nan=1.0))


def _boxes(centre: Floats, extent: Floats, size: tuple[int, int]) -> Footprints:
    """Boxes of whole pixels about centres (n, 2), clipped to the image, int16 (n, 4)."""
    sides = np.rint(extent).clip(1, LARGEST_SIDE)
    first = np.rint(centre - (sides - 1) / 2)
    stop = (first + sides).clip(1, size)
    first = first.clip(0, stop - 1)
    return np.concatenate([first, stop - first], -1).astype(np.int16)
