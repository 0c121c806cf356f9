"""A camera's frame with the ground's grid and upright poles drawn on it: does the rig lie where the floor does?"""

from __future__ import annotations

import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats
from stseg.geometry import Camera, Grid
from stseg.reporting.pictures.canvas import chip, disc, stroke, text
from stseg.reporting.pictures.colours import INK, PAPER, Colour
from stseg.reporting.pictures.overlay import OverlayView

_LINE: Colour = (255, 196, 64)
_BORDER: Colour = (64, 220, 255)
_POLE: Colour = (80, 80, 255)
_MAX_LINES = 14
_LINE_DISTANCES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_POLES = 4
"""Along the longer side of the area."""
_TALL = 1.7
"""Metres."""


def grid_picture(camera: Camera, grid: Grid, image: Bytes | None, frame: int, width: int = 1280) -> Bytes:
    """The ground's metres, and poles as tall as most people with a mark at each half metre, over a camera's frame.

    Parameters
    ----------
    camera
    grid
    image : uint8 (v, u, 3) or (v, u) or None
        As in `overlay`.
    frame
        Its number.
    width
        Of the picture, pixels.

    Returns
    -------
    uint8 (v, u, 3)
        Blue, green, red.
    """
    view = OverlayView(camera, width)
    canvas = view.canvas(image)
    side = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
    step = next((s for s in _LINE_DISTANCES if s * _MAX_LINES >= side), _LINE_DISTANCES[-1])
    for x in _stops(grid.x, step):
        _line(canvas, view, np.full(400, x), np.linspace(*grid.y, 400), x in grid.x)
    for y in _stops(grid.y, step):
        _line(canvas, view, np.linspace(*grid.x, 400), np.full(400, y), y in grid.y)
    for ground in sorted(_pole_places(grid), key=lambda place: -float(np.hypot(*(place - camera.centre[:2])))):
        _pole(canvas, view, ground)
    text(
        canvas, f"{camera.name}  frame {frame}  lines every {step:g} m, poles {_TALL} m", (18, 16), PAPER, 14, (0, 0), 2
    )
    return canvas


def _stops(bounds: tuple[float, float], step: float) -> list[float]:
    low, high = bounds
    inner = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    return sorted({low, high, *inner.tolist()})


def _line(canvas: Bytes, view: OverlayView, x: Floats, y: Floats, is_border: bool) -> None:
    stroke(canvas, view.pixel(np.stack([x, y], -1), 0.0), _BORDER if is_border else _LINE, 2 if is_border else 1)


def _pole_places(grid: Grid) -> list[Floats]:
    """Whole metres where the area allows, inside it."""
    side = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]) / _POLES
    x, y = (
        np.round(np.arange(low + side / 2, high, side)) if side >= 1 else np.arange(low + side / 2, high, side)
        for low, high in (grid.x, grid.y)
    )
    return list(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))


def _pole(canvas: Bytes, view: OverlayView, ground: AnyArray) -> None:
    heights = np.linspace(0.0, _TALL, 35)
    pixel = view.pixel(np.broadcast_to(ground, (len(heights), 2)), heights)
    if not np.isfinite(pixel).all():
        return
    stroke(canvas, pixel, INK, 5)
    stroke(canvas, pixel, _POLE, 3)
    for mark in (0.0, 0.5, 1.0, 1.5):
        disc(canvas, view.pixel(np.asarray(ground), mark), 4, _POLE)
    u, v = pixel[-1].tolist()
    if 0 <= u < view.size[0] and 24 <= v < view.size[1]:
        chip(canvas, f"{ground[0] + 0.0:g}, {ground[1] + 0.0:g}", (u, v - 12), _POLE, 10)
