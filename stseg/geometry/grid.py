"""The occupancy grid: cells of a ground rectangle, and planes above them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stseg.arrays import Flags, Floats


@dataclass(frozen=True)
class Grid:
    """Ground cells and planes.

    Attributes
    ----------
    x, y
        Lower and upper bound of the ground rectangle, metres.
    cell
        Side of a cell, metres.
    top
        Height of the uppermost plane, metres.
    planes
        Number of planes, at linspace(0, top, planes).
    polygon : float64 (n, 2) or None
        The part of the rectangle that counts, metres; None for the whole.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    cell: float = 0.10
    top: float = 1.80
    planes: int = 10
    polygon: Floats | None = None

    def __repr__(self) -> str:
        polygon = "" if self.polygon is None else f", a polygon of {len(self.polygon)} corners"
        return f"Grid(x={self.x}, y={self.y}, cell={self.cell:g}, top={self.top:g}, planes={self.planes}{polygon})"

    @property
    def shape(self) -> tuple[int, int, int]:
        """(plane, y, x)."""
        return self.planes, _count(self.y, self.cell), _count(self.x, self.cell)

    @cached_property
    def ground_x(self) -> Floats:
        """Cell centres along x, metres, float64 (x,)."""
        return np.asarray(self.x[0] + (np.arange(self.shape[2]) + 0.5) * self.cell, float)

    @cached_property
    def ground_y(self) -> Floats:
        """Cell centres along y, metres, float64 (y,)."""
        return np.asarray(self.y[0] + (np.arange(self.shape[1]) + 0.5) * self.cell, float)

    @cached_property
    def heights(self) -> Floats:
        """Heights of the planes, metres, float64 (plane,)."""
        return np.linspace(0.0, self.top, self.planes)

    @cached_property
    def ground(self) -> Floats:
        """Cell centres, metres, float64 (y, x, 2)."""
        return np.stack(np.meshgrid(self.ground_x, self.ground_y), -1)

    @property
    def corners(self) -> Floats:
        """Corners of the area, the polygon or else the rectangle, metres, float64 (n, 2)."""
        (x0, x1), (y0, y1) = self.x, self.y
        rectangle = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        return np.asarray(rectangle if self.polygon is None else self.polygon, float)

    def cell_of(self, ground: Floats) -> Floats:
        """Cell coordinates (x, y) of ground points; cell centres are integers, float64 (..., 2)."""
        return (np.asarray(ground, float) - (self.x[0], self.y[0])) / self.cell - 0.5

    def edge_distance(self, ground: Floats) -> Floats:
        """Distance of points (..., 2) from the nearest edge of the rectangle, metres, float64 (...); 0 beyond."""
        x, y = ground[..., 0], ground[..., 1]
        nearest = np.minimum(np.minimum(x - self.x[0], self.x[1] - x), np.minimum(y - self.y[0], self.y[1] - y))
        return np.asarray(np.maximum(nearest, 0.0))

    def contains(self, ground: Floats) -> Flags:
        """Whether points (..., 2), metres, lie in the area: the rectangle and the polygon, bool (...)."""
        x, y = ground[..., 0], ground[..., 1]
        inside = (self.x[0] <= x) & (x <= self.x[1]) & (self.y[0] <= y) & (y <= self.y[1])
        return inside if self.polygon is None else inside & inside_polygon(ground, self.polygon)

    def inside(self) -> Flags:
        """Cells with centres within the polygon, all without one, bool (y, x)."""
        if self.polygon is None:
            return np.ones(self.shape[1:], bool)
        within = np.zeros(self.shape[1:], bool)
        x, y = self.ground_x, self.ground_y
        for (x0, y0), (x1, y1) in zip(self.polygon, np.roll(self.polygon, -1, axis=0), strict=True):
            rows = np.flatnonzero((y0 > y) != (y1 > y))
            if len(rows):  # most edges of a fine polygon cross few rows
                within[rows] ^= x < ((x1 - x0) * (y[rows] - y0) / (y1 - y0) + x0)[:, None]
        return within

    def touching(self, rectangle: tuple[float, float, float, float]) -> Flags:
        """Cells that a rectangle x0, y0, x1, y1 touches, metres, bool (y, x)."""
        # A point between two cells touches both, and rounding must not leave it to neither.
        (x0, y0, x1, y1), half = rectangle, self.cell / 2 * (1 + 1e-9)
        columns = (self.ground_x >= x0 - half) & (self.ground_x <= x1 + half)
        rows = (self.ground_y >= y0 - half) & (self.ground_y <= y1 + half)
        return rows[:, None] & columns


def inside_polygon(ground: Floats, polygon: Floats) -> Flags:
    """Even-odd rule for points (..., 2) and a closed polygon (n, 2), both metres; bool (...)."""
    x, y = ground[..., 0], ground[..., 1]
    within = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            within ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return within


def _count(bounds: tuple[float, float], cell: float) -> int:
    return max(1, round((bounds[1] - bounds[0]) / cell))
