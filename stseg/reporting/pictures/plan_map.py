"""Map from metres to pixels of the plan view, and its ruled sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats
from stseg.geometry import Grid
from stseg.reporting.pictures.canvas import blank, outline, stroke, text, text_size
from stseg.reporting.pictures.colours import INK, PAPER, QUIET, RULE

_LEFT_MARGIN, _RIGHT_MARGIN, _TOP_MARGIN, _BOTTOM_MARGIN = 76, 44, 104, 132  # for title, labels and legend, pixels
LEGEND_WIDTH = 900
"""Least width of a plan with a legend, pixels."""
_ROUND_DISTANCES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)


@dataclass(frozen=True)
class PlanMap:
    """Metres on the ground to pixels of a plan view; y points up."""

    x: tuple[float, float]
    y: tuple[float, float]
    """Ground rectangle of the picture, metres."""
    scale: float
    """Pixels a metre."""
    corner: tuple[float, float]
    """Pixel of the upper left corner (least x, greatest y)."""
    size: tuple[int, int]
    """Width and height of the canvas, pixels."""

    @classmethod
    def fit(cls, grid: Grid, places: AnyArray, width: int, height: int, least_width: int = LEGEND_WIDTH) -> PlanMap:
        """The largest map of the grid's rectangle, and of places (n, 2) beside it, on a canvas of at most that size."""
        x, y = _bounds(grid, places)
        space = (width - _LEFT_MARGIN - _RIGHT_MARGIN, height - _TOP_MARGIN - _BOTTOM_MARGIN)
        scale = min(space[0] / (x[1] - x[0]), space[1] / (y[1] - y[0]))
        wide, tall = scale * (x[1] - x[0]), scale * (y[1] - y[0])
        size = (
            max(round(wide) + _LEFT_MARGIN + _RIGHT_MARGIN, least_width),
            round(tall) + _TOP_MARGIN + _BOTTOM_MARGIN,
        )
        spare = size[0] - _LEFT_MARGIN - _RIGHT_MARGIN - wide
        return cls(x, y, scale, (_LEFT_MARGIN + spare / 2, float(_TOP_MARGIN)), size)

    def pixel(self, ground: AnyArray) -> Floats:
        """Pixels of ground points, float64 (..., 2)."""
        ground = np.asarray(ground, float)
        u = self.corner[0] + (ground[..., 0] - self.x[0]) * self.scale
        v = self.corner[1] + (self.y[1] - ground[..., 1]) * self.scale
        return np.stack([u, v], -1)

    @property
    def far_corner(self) -> tuple[float, float]:
        """Pixel of the lower right corner."""
        u, v = self.pixel(np.array([self.x[1], self.y[0]])).tolist()
        return u, v

    def covers_numbers(self, low: Floats, high: Floats) -> bool:
        """Whether a rectangle of the canvas lies on the numbers of `rule`, below and left of the ground."""
        (left, top), (right, bottom) = self.corner, self.far_corner
        below = high[1] > bottom + 8 and low[1] < bottom + 34 and low[0] < right + 24 and high[0] > left - 24
        left_of = high[0] > left - 60 and low[0] < left - 8 and low[1] < bottom + 12 and high[1] > top - 12
        return bool(below or left_of)


def sheet(plan: PlanMap, title: str) -> Bytes:
    """An empty plan: white paper and a title."""
    canvas = blank(*plan.size, PAPER)
    text(canvas, title, (plan.corner[0], 24), INK, 20, (0, 0), 2)
    return canvas


def rule(canvas: Bytes, plan: PlanMap) -> None:
    """Grid lines every metre (wider apart where they would crowd), with labels in metres."""
    step = step_for(plan.scale, 12, 1.0)
    label_step = step_for(plan.scale, 56, step)
    (left, top), (right, bottom) = plan.corner, plan.far_corner
    for metres in _multiples(plan.x, step):
        u = plan.pixel(np.array([metres, 0.0]))[0]
        stroke(canvas, np.array([[u, top], [u, bottom]]), RULE)
        if _is_multiple(metres, label_step):
            text(canvas, f"{metres + 0.0:g}", (u, bottom + 14), QUIET, 15, (0.5, 0))
    for metres in _multiples(plan.y, step):
        v = plan.pixel(np.array([0.0, metres]))[1]
        stroke(canvas, np.array([[left, v], [right, v]]), RULE)
        if _is_multiple(metres, label_step):
            text(canvas, f"{metres + 0.0:g}", (left - 14, v), QUIET, 15, (1, 0.5))
    outline(canvas, np.array([[left, top], [right, top], [right, bottom], [left, bottom]]), RULE)
    text(canvas, "x and y, metres", (right, bottom + 42), QUIET, 15, (1, 0))


def scale_bar(canvas: Bytes, plan: PlanMap, place: tuple[float, float]) -> None:
    """A bar of a round number of metres with its right end at `place`."""
    metres = max((step for step in _ROUND_DISTANCES if step * plan.scale <= 180), default=_ROUND_DISTANCES[0])
    (u, v), length = place, metres * plan.scale
    words = f"{metres:g} m"
    stroke(canvas, np.array([[u - length, v], [u, v]]), INK, 3)
    for end in (u - length, u):
        stroke(canvas, np.array([[end, v - 6], [end, v + 6]]), INK, 2)
    text(canvas, words, (u - length - 12 - text_size(words, 16)[0], v), INK, 16, (0, 0.5))


def step_for(scale: float, pixels: float, least: float) -> float:
    """The least round number of metres, `least` or more, that is so many pixels long or longer."""
    fitting = (step for step in _ROUND_DISTANCES if step >= least and step * scale >= pixels)
    return min(fitting, default=_ROUND_DISTANCES[-1])


def _bounds(grid: Grid, places: AnyArray) -> tuple[tuple[float, float], tuple[float, float]]:
    """The rectangle and a little around it, wider where places lie beyond."""
    margin = 0.04 * max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
    spans = []
    for axis, (low, high) in enumerate((grid.x, grid.y)):
        coordinates = np.asarray(places, float).reshape(-1, 2)[:, axis]
        spans.append((min([low, *coordinates]) - margin, max([high, *coordinates]) + margin))
    return spans[0], spans[1]


def _multiples(bounds: tuple[float, float], step: float) -> list[float]:
    first, last = np.ceil(bounds[0] / step - 1e-9), np.floor(bounds[1] / step + 1e-9)
    return [float(k * step) for k in np.arange(first, last + 1)]


def _is_multiple(metres: float, step: float) -> bool:
    return abs(metres / step - round(metres / step)) < 1e-6
