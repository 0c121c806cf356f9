"""Projection of standing bodies into a view: boxes and outlines of pillars, from one table of projected points.

A body is a pillar of revolution: discs with a radius at each relative height (feet, trunk, head). A lattice of ground
points is projected once at some levels; between them pixels are interpolated, linearly in x, y and height, so
that a lens or a tilt bends the pillar as it bends the image. A disc projects to an ellipse by the Jacobian of that map.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.geometry.camera import Camera
from stseg.geometry.grid import Grid
from stseg.kernels.accelerate import kernel, part

LEVELS = np.linspace(0.0, 2.2, 12)
"""Heights at which the lattice is projected, metres."""
_LEVEL_STEP = float(LEVELS[1])
PROFILE = np.array([[0.0, 0.13], [0.25, 0.15], [0.5, 0.21], [0.8, 0.23], [0.88, 0.13], [1.0, 0.08]])
"""Relative height and radius (metres) of a body's discs, as detectors draw boxes: with a margin above the head."""
SILHOUETTE = np.array([[0.0, 0.13], [0.25, 0.15], [0.5, 0.20], [0.8, 0.22], [0.86, 0.11], [0.95, 0.10], [1.0, 0.02]])
"""The same as pixels show it: the head closes at the crown, also where the camera looks down on it."""
WIDTH = 2 * float(SILHOUETTE[:, 1].max())
"""Width of that silhouette across shoulders and arms, metres. Wider people are wider at all heights."""


class BodyTable(NamedTuple):
    """Projected lattice of one view."""

    origin: tuple[float, float]
    step: float
    """Ground position of the first lattice point and the lattice's spacing, metres."""
    pixel: Singles
    """float32 (y, x, level, 2): pixel of each lattice point at each level, which a body needs together; nan where the
    camera does not see it."""
    size: tuple[int, int]
    """Width and height of the image, pixels."""
    breadth: float = 1.0
    """Ratio of the radii of boxes' pillars to those of people."""

    @classmethod
    def of(cls, camera: Camera, grid: Grid, step: float = 0.12, margin: float = 0.6, breadth: float = 1.0) -> BodyTable:
        """The table of `camera` over the grid's rectangle and `margin` metres around it."""
        x = np.arange(grid.x[0] - margin, grid.x[1] + margin + step, step)
        y = np.arange(grid.y[0] - margin, grid.y[1] + margin + step, step)
        ground = np.stack(np.meshgrid(x, y), -1)
        pixel = np.full((len(y), len(x), len(LEVELS), 2), np.nan, np.float32)
        for k, level in enumerate(LEVELS):
            place, ahead = camera.project(ground, float(level))
            with np.errstate(over="ignore"):  # beyond any image
                pixel[:, :, k] = np.where(ahead[..., None], place, np.nan)
        return cls((float(x[0]), float(y[0])), step, pixel, camera.size, breadth)

    def boxes(self, ground: Floats, heights: Floats) -> Floats:
        """Boxes of pillars in this view.

        Parameters
        ----------
        ground : float64 (n, 2)
            Places, metres.
        heights : float64 (h,)
            Body heights, metres.

        Returns
        -------
        float64 (h, n, 4)
            left, top, right, bottom in pixels, not clipped to the image; nan where the view cannot see the place.
        """
        return np.stack([self.boxes_of(ground, np.full(len(ground), height)) for height in heights])

    def boxes_of(self, ground: Floats, heights: Floats) -> Floats:
        """Boxes of pillars with a height each, ground (n, 2) and heights (n,) in metres; float64 (n, 4), pixels."""
        filled = np.empty((len(ground), 4))
        place, tall = np.ascontiguousarray(ground, float), np.asarray(heights, float)
        _fill_boxes(self, place, tall, filled)
        return filled


@kernel
def fill_levels(table: BodyTable, x: float, y: float, levels: Floats) -> None:
    """Fill levels (level, 6) with the pixel u, v of a ground point, metres, at each level, and its Jacobian.

    The Jacobian is that of u, then of v, in pixels for each step of the lattice.
    """
    pixel = table.pixel
    rows, columns, count, _ = pixel.shape
    lattice_x, lattice_y = (x - table.origin[0]) / table.step, (y - table.origin[1]) / table.step
    column = min(max(int(np.floor(lattice_x)), 0), columns - 2)
    row = min(max(int(np.floor(lattice_y)), 0), rows - 2)
    a, b = lattice_x - column, lattice_y - row
    here, right, below = np.uint64(column), np.uint64(column + 1), np.uint64(row + 1)
    first, second = pixel[np.uint64(row), here], pixel[np.uint64(row), right]
    third, fourth = pixel[below, here], pixel[below, right]
    for level in range(np.uint64(count)):
        for axis in range(np.uint64(2)):
            upper_slope = second[level, axis] - float(first[level, axis])
            lower_slope = fourth[level, axis] - float(third[level, axis])
            upper, lower = first[level, axis] + upper_slope * a, third[level, axis] + lower_slope * a
            levels[level, axis] = upper + (lower - upper) * b
            levels[level, 2 + 2 * axis] = upper_slope + (lower_slope - upper_slope) * b
            levels[level, 3 + 2 * axis] = lower - upper


@kernel
def fill_discs(levels: Floats, height: float, profile: Floats, step: float, discs: Floats) -> None:
    """Fill discs (disc, 6) with the centre u, v of each disc of a body, and its Jacobian times the radius, pixels.

    `levels` float64 (level, 6) are those of the body's place on a lattice of a step, metres.
    """
    for k in range(np.uint64(len(profile))):
        z = profile[k, 0] * height / _LEVEL_STEP
        level = min(max(int(np.floor(z)), 0), len(levels) - 2)
        c, radius, low, high = z - level, profile[k, 1] / step, np.uint64(level), np.uint64(level + 1)
        for m in range(np.uint64(6)):
            value = levels[low, m] + (levels[high, m] - levels[low, m]) * c
            discs[k, m] = value if m < np.uint64(2) else value * radius


@part
def box_of(discs: Floats, breadth: float) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a body's discs (disc, 6), pixels; nan where the view cannot see all of them."""
    left, top, right, bottom, total = np.inf, np.inf, -np.inf, -np.inf, 0.0
    for k in range(len(discs)):
        wide = breadth * math.sqrt(discs[k, 2] * discs[k, 2] + discs[k, 3] * discs[k, 3])
        tall = breadth * math.sqrt(discs[k, 4] * discs[k, 4] + discs[k, 5] * discs[k, 5])
        left, right = min(left, discs[k, 0] - wide), max(right, discs[k, 0] + wide)
        top, bottom = min(top, discs[k, 1] - tall), max(bottom, discs[k, 1] + tall)
        total += wide + tall
    return (np.nan, np.nan, np.nan, np.nan) if np.isnan(total) else (left, top, right, bottom)


@kernel
def _fill_boxes(table: BodyTable, ground: Floats, heights: Floats, filled: Floats) -> None:
    levels, discs = np.empty((len(LEVELS), 6)), np.empty((len(PROFILE), 6))
    for i in range(len(ground)):
        fill_levels(table, ground[i, 0], ground[i, 1], levels)
        fill_discs(levels, heights[i], PROFILE, table.step, discs)
        filled[i, 0], filled[i, 1], filled[i, 2], filled[i, 3] = box_of(discs, table.breadth)


def inside_bodies(grid: Grid, near_person: Ints, ground: Floats, height: Floats) -> Flags:
    """Cells that the pillar of the person near them fills, bool (plane, y, x).

    Parameters
    ----------
    near_person : int64 (y, x)
        The person near each cell, -1 for none.
    ground, height : float64 (person, 2), (person,)
        Metres.
    """
    inside = np.zeros(grid.shape, bool)
    within_reach = near_person >= 0
    person = near_person[within_reach]
    distance = np.hypot(*(grid.ground[within_reach] - ground[person]).T)
    for plane, above in zip(inside, grid.heights, strict=True):
        plane[within_reach] = distance <= np.interp(above / height[person], PROFILE[:, 0], PROFILE[:, 1], right=-1.0)
    return inside
