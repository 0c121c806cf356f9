"""Footprints: the pixels of each view that show each cell, computed once.

A cell covers many pixels of a near view and a part of one of a far view. Its *footprint* is the axis-aligned box of
pixels about its centre with the spread of its image: a square of side c that J (the Jacobian of ground metres to
pixels, lens included) takes into the image has the covariance c^2 J J^T / 12, so the box of the same variances is

    c |dU/d(x, y)| pixels wide and c |dV/d(x, y)| pixels high,

at least one pixel each way. Point sampling is the footprint of one pixel. Kernels project one point at a time, as
`Camera.project` does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Bytes, Flags, Floats, Singles
from stseg.geometry import Camera, Rig
from stseg.geometry.lens import Lens
from stseg.geometry.summed_area import LARGEST_SIDE
from stseg.kernels.accelerate import kernel, part

SamplingKind = Literal["footprint", "point"]
Footprints = NDArray[np.int16]
"""int16 (..., 4): left, top, width and height in pixels; all 0 where the view does not see the cell."""

_DERIVATIVE_STEP = 1e-3
"""Distance over which derivatives are taken, shares of a cell's side."""


@dataclass(frozen=True)
class Sampling:
    """Look-up tables of a rig."""

    footprint: Footprints
    """int16 (view, plane, y, x, 4): the pixels that show each cell; width 0 where the view does not see it, or it lies
    outside the area."""
    distance: Singles
    """float32 (view, y, x): distance of the cell from the camera along the ground, metres."""

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
    visible = extent > 0
    start = int(first[visible].min(initial=32767))
    return slice(start, max(start, int((first + extent)[visible].max(initial=0))))


def _footprints(camera: Camera, rig: Rig, kind: SamplingKind) -> Footprints:
    footprint, within = np.zeros((*rig.grid.shape, 4), np.int16), rig.grid.inside()
    lens, ground, projection = LensTerms.of(camera.lens), rig.grid.ground, camera.projection
    shift = (_DERIVATIVE_STEP * rig.grid.cell / 2) if kind == "footprint" else 0.0
    for boxes, height in zip(footprint, rig.grid.heights.tolist(), strict=True):
        centre, ahead = camera.project(ground, height)
        visible = ahead & camera.inside(centre) & within
        _fill_boxes(ground, height, projection, lens, centre, visible, shift, camera.size, boxes)
    return footprint


@kernel
def _fill_boxes(
    ground: Floats,
    height: float,
    projection: Floats,
    lens: LensTerms,
    centre: Floats,
    visible: Flags,
    shift: float,
    size: tuple[int, int],
    boxes: Footprints,
) -> None:
    """Fill boxes (y, x, 4) of whole pixels, clipped to the image, about the centres (y, x, 2) of cells that are seen.

    Their sides are the derivative of the pixel, by a shift in metres to either side along x and y, times the cell's
    side; one pixel where the shift is 0 or there is no derivative.
    """
    for j in range(visible.shape[0]):
        for i in range(visible.shape[1]):
            if not visible[j, i]:
                continue
            x, y, wide, tall = ground[j, i, 0], ground[j, i, 1], 1.0, 1.0
            if shift > 0:
                east = pixel_of(projection, lens, x + shift, y, height)
                west = pixel_of(projection, lens, x - shift, y, height)
                north = pixel_of(projection, lens, x, y + shift, height)
                south = pixel_of(projection, lens, x, y - shift, height)
                wide = _extent(east[0] - west[0], north[0] - south[0])
                tall = _extent(east[1] - west[1], north[1] - south[1])
            boxes[j, i, 0], boxes[j, i, 2] = _span_about(centre[j, i, 0], wide, size[0])
            boxes[j, i, 1], boxes[j, i, 3] = _span_about(centre[j, i, 1], tall, size[1])


@part
def _extent(along_x: float, along_y: float) -> float:
    """Pixels that a cell spans, from its pixel's differences over a share of a cell; 1 where they are not numbers."""
    extent = math.sqrt((along_x / _DERIVATIVE_STEP) ** 2 + (along_y / _DERIVATIVE_STEP) ** 2)
    return 1.0 if math.isnan(extent) else extent


@part
def _span_about(centre: float, extent: float, size: int) -> tuple[int, int]:
    """First pixel and number of pixels of a span about a centre, inside the image."""
    side = min(max(np.rint(extent), 1.0), float(LARGEST_SIDE))
    first = np.rint(centre - (side - 1) / 2)
    stop = min(max(first + side, 1.0), float(size))
    first = min(max(first, 0.0), stop - 1)
    return int(first), int(stop - first)


class LensTerms(NamedTuple):
    """A lens for kernels."""

    matrix: Floats
    """float64 (3, 3): camera matrix, pixels."""
    distortion: Floats
    """float64 (8,): k1, k2, p1, p2, k3, k4, k5, k6, or k1 to k4 of a fisheye; all 0 for an ideal image."""
    bends: bool
    fisheye: bool
    """bool each: whether there is a lens, and whether it is a fisheye."""

    @classmethod
    def of(cls, lens: Lens | None) -> Self:
        """From a camera's lens."""
        distortion = np.zeros(8)
        if lens is None:
            return cls(np.eye(3), distortion, False, False)
        distortion[: len(lens.distortion)] = lens.distortion
        return cls(lens.matrix, distortion, True, lens.model == "fisheye")


@part
def pixel_of(projection: Floats, lens: LensTerms, x: float, y: float, z: float) -> tuple[float, float]:
    """Pixel of a point in space, metres; nan behind the camera. The lens's fold is not asked."""
    p = projection
    away = p[2, 0] * x + p[2, 1] * y + p[2, 2] * z + p[2, 3]
    if not away > 0:
        return np.nan, np.nan
    u = (p[0, 0] * x + p[0, 1] * y + p[0, 2] * z + p[0, 3]) / away
    v = (p[1, 0] * x + p[1, 1] * y + p[1, 2] * z + p[1, 3]) / away
    return _bent(lens, u, v) if lens.bends else (u, v)


@part
def _bent(lens: LensTerms, u: float, v: float) -> tuple[float, float]:
    """Where the lens shows an undistorted pixel; see `Lens.distort`."""
    matrix, d = lens.matrix, lens.distortion
    k1, k2, p1, p2, k3, k4, k5, k6 = d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]
    y = (v - matrix[1, 2]) / matrix[1, 1]
    x = (u - matrix[0, 2] - matrix[0, 1] * y) / matrix[0, 0]
    square = x * x + y * y
    if lens.fisheye:
        radius = math.sqrt(max(square, 1e-12))
        angle = math.atan(radius)
        turn = angle * angle
        radial = angle / radius * (1 + turn * (k1 + turn * (k2 + turn * (p1 + turn * p2))))  # p1, p2: its k3, k4
        p1 = p2 = 0.0
    else:
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        radial /= 1 + square * (k4 + square * (k5 + square * k6))
    bent_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    bent_y = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    bent_u = matrix[0, 0] * bent_x + matrix[0, 1] * bent_y + matrix[0, 2]
    return bent_u, matrix[1, 0] * bent_x + matrix[1, 1] * bent_y + matrix[1, 2]
