"""Overlays on a camera's image: tracks (pillars, ids and trails), or the ground's grid with upright poles."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Rows, ground_of
from stseg.bodies.pillars import PROFILE
from stseg.geometry import Camera, Grid
from stseg.geometry.rig import BODY_HEIGHT
from stseg.records.track_heights import with_heights
from stseg.reporting.pictures.canvas import blank, chip, chips, disc, fading_stroke, fill, outline, stroke, text
from stseg.reporting.pictures.colours import INK, NIGHT, PAPER, Colour, Picture, mixed, track_colour

_SUBPIXELS = 4  # sub-pixels a pixel of a pillar's outline
_CIRCLE_ANGLES = np.linspace(0, 2 * np.pi, 33)[:-1]
_RULE = mixed(NIGHT, PAPER, 0.22)
_RULE_STYLES = ((_RULE, 1), (mixed(_RULE, PAPER, 0.3), 2))
"""Colour and width of the ground's metres, and of its border."""
_GRID_STYLES: tuple[tuple[Colour, int], ...] = (((255, 196, 64), 1), ((64, 220, 255), 2))
"""The same of `grid_picture`."""
_LABEL_SHARES = np.linspace(1.0, 0.0, 9)
"""Shares of a body's height, from above; the first that is in the picture has the id."""
_POLE_COLOUR: Colour = (80, 80, 255)
_MAX_LINES = 14
_LINE_DISTANCES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # metres
_POLES = 4
"""Along the longer side of the area."""


def overlay(
    camera: Camera, grid: Grid, image: Bytes | None, trajectory: Rows, frame: int, trail: int = 25, width: int = 1280
) -> Picture:
    """Draw the people of a frame over a camera's image.

    Parameters
    ----------
    camera
        The view.
    grid
        Its rectangle is ruled in metres where there is no colour frame.
    image : uint8 (v, u, 3) or (v, u) or None
        A colour frame, a mask (shown in greys), or nothing: a dark canvas with the ground's grid.
    trajectory : TRAJECTORY (n,)
        Rows of other frames are the trails.
    frame
        The frame to show.
    trail
        How many frames a trail reaches back.
    width
        Width of the picture, pixels.
    """
    view = OverlayView(camera, width)
    canvas = view.canvas(image)
    if image is None or image.ndim == 2:
        (x0, x1), (y0, y1) = grid.x, grid.y
        stops = [*np.arange(np.ceil(x0), x1), x0, x1], [*np.arange(np.ceil(y0), y1), y0, y1]
        _ground_lines(canvas, view, grid, *stops, _RULE_STYLES)
    trajectory = with_heights(trajectory)
    present = trajectory[trajectory["frame"] == frame]
    recent = trajectory[(trajectory["frame"] <= frame) & (trajectory["frame"] >= frame - trail)]
    for row in present:
        _draw_trail(canvas, view, recent[recent["id"] == row["id"]], frame, trail)
    distance = np.hypot(present["x"] - camera.centre[0], present["y"] - camera.centre[1])
    for row in present[np.argsort(-distance, kind="stable")]:
        _draw_pillar(canvas, view, row)
    _label(canvas, view, present)
    text(canvas, f"{camera.name}  frame {frame}", (18, 16), PAPER, 14, (0, 0), 2)
    return canvas


@dataclass(frozen=True)
class OverlayView:
    """A camera with its image scaled to `width` pixels."""

    camera: Camera
    width: int

    @property
    def scale(self) -> float:
        return self.width / self.camera.size[0]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, pixels."""
        return self.width, round(self.camera.size[1] * self.scale)

    def canvas(self, image: Bytes | None) -> Bytes:
        """The image in the picture's size, a little darker than it was; or a dark canvas."""
        if image is None:
            return blank(*self.size, NIGHT)
        scaled = cv2.resize(image, self.size, interpolation=cv2.INTER_AREA if self.scale < 1 else cv2.INTER_LINEAR)
        if image.ndim == 2:
            tones = np.linspace(NIGHT, mixed(NIGHT, PAPER, 0.5), 256)
            return np.asarray(np.rint(tones)[scaled], np.uint8)
        return np.asarray(cv2.convertScaleAbs(scaled, alpha=0.85), np.uint8)

    def pixel(self, ground: AnyArray, height: AnyArray | float) -> Floats:
        """Where the picture shows points, float64 (..., 2); nan behind the camera and far off the picture."""
        place, ahead = self.camera.project(np.asarray(ground, float), np.asarray(height, float))
        place = (place + 0.5) * self.scale - 0.5
        limit = np.array(self.size)
        drawable = ahead & (np.abs(place - limit / 2) < 1.5 * limit).all(axis=-1)
        return np.asarray(np.where(drawable[..., None], place, np.nan))


def pillar_outline(view: OverlayView, ground: Floats, height: float) -> list[Floats]:
    """Outlines of a standing body (`PROFILE`) in the picture: closed polygons float64 (n, 2), none where it is unseen.

    Each slice between two discs shows as the convex hull of both; the body is their union.
    """
    around = np.stack([np.cos(_CIRCLE_ANGLES), np.sin(_CIRCLE_ANGLES)], -1)
    discs = ground + PROFILE[:, 1, None, None] * around
    pixel = view.pixel(discs, np.broadcast_to((PROFILE[:, 0] * height)[:, None], discs.shape[:2]))
    if not np.isfinite(pixel).all():
        return []
    low = np.floor(pixel.min(axis=(0, 1))) - 2
    wide, tall = (np.ceil(np.ptp(pixel.reshape(-1, 2), axis=0)).astype(int) + 5).tolist()
    mask = np.zeros((tall * _SUBPIXELS, wide * _SUBPIXELS), np.uint8)
    fine = np.rint((pixel - low) * _SUBPIXELS).astype(np.int32)
    for below, above in pairwise(fine):
        cv2.fillConvexPoly(mask, cv2.convexHull(np.concatenate([below, above])), 255)
    found, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return [cv2.approxPolyDP(contour, 1.2, True)[:, 0] / _SUBPIXELS + low for contour in found]


def _draw_pillar(canvas: Bytes, view: OverlayView, row: np.void) -> None:
    ground, colour = np.array([row["x"], row["y"]]), track_colour(int(row["id"]))
    foot = view.pixel(ground, 0.0)
    whole = bool((foot >= 0).all() and (foot < view.size).all())  # a body that is cut fills the picture
    for polygon in pillar_outline(view, ground, float(row["height"])):
        fill(canvas, polygon, colour, 0.28 if whole else 0.06)
        outline(canvas, polygon, mixed(colour, PAPER, 0.15), 2 if whole else 1)
    if whole:
        disc(canvas, foot, 6.5, PAPER)
        disc(canvas, foot, 5, colour)


def _draw_trail(canvas: Bytes, view: OverlayView, rows: Rows, frame: int, trail: int) -> None:
    """The trail on the ground, fading with age."""
    rows = rows[np.argsort(rows["frame"], kind="stable")]
    pixel = view.pixel(ground_of(rows), 0.0)
    colour = track_colour(int(rows["id"][0]))
    age = (frame - rows["frame"][:-1]) / max(trail, 1)
    fading_stroke(canvas, pixel, colour, 1 - 0.85 * age)


def _label(canvas: Bytes, view: OverlayView, people: Rows) -> None:
    """Ids above the heads, or at the highest part of a body in the picture."""
    ground, tops = ground_of(people), people["height"] + 0.12
    axis = np.stack([view.pixel(ground, share * tops) for share in _LABEL_SHARES])
    inside = np.isfinite(axis).all(axis=2) & (axis >= 0).all(axis=2) & (axis < view.size).all(axis=2)
    chosen = np.flatnonzero(inside.any(axis=0))
    heads, people = axis[inside.argmax(axis=0)[chosen], chosen], people[chosen]
    ids, bounds = people["id"].tolist(), (4, 4, view.size[0] - 4, view.size[1] - 4)
    chips(canvas, heads, [*map(str, ids)], map(track_colour, ids), 13, bounds)


def _ground_lines(
    canvas: Bytes,
    view: OverlayView,
    grid: Grid,
    x_stops: Sequence[float],
    y_stops: Sequence[float],
    styles: tuple[tuple[Colour, int], ...],
) -> None:
    """Lines over the whole ground at x and at y, in the second style where they are its border."""
    along_x, along_y = np.linspace(*grid.x, 400), np.linspace(*grid.y, 400)
    lines = [(np.full(400, x), along_y, x in grid.x) for x in x_stops]
    lines += [(along_x, np.full(400, y), y in grid.y) for y in y_stops]
    for x, y, is_border in lines:
        stroke(canvas, view.pixel(np.stack([x, y], -1), 0.0), *styles[is_border])


def grid_picture(camera: Camera, grid: Grid, image: Bytes | None, frame: int, width: int = 1280) -> Picture:
    """The ground's metres, and poles as tall as most people with a mark at each half metre, over a camera's frame.

    `image` is as in `overlay`, `frame` its number, `width` that of the picture, pixels.
    """
    view = OverlayView(camera, width)
    canvas = view.canvas(image)
    side = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
    step = next((s for s in _LINE_DISTANCES if s * _MAX_LINES >= side), _LINE_DISTANCES[-1])
    _ground_lines(canvas, view, grid, _stops(grid.x, step), _stops(grid.y, step), _GRID_STYLES)
    places = sorted(_pole_places(grid), key=lambda place: float(np.hypot(*(place - camera.centre[:2]))))
    for ground in reversed(places):
        _pole(canvas, view, ground)
    _pole_labels(canvas, view, places)
    words = f"{camera.name}  frame {frame}  lines every {step:g} m, poles {BODY_HEIGHT} m"
    text(canvas, words, (18, 16), PAPER, 14, (0, 0), 2)
    return canvas


def _stops(bounds: tuple[float, float], step: float) -> list[float]:
    low, high = bounds
    inner = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    return sorted({low, high, *inner.tolist()})


def _pole_places(grid: Grid) -> list[Floats]:
    """Whole metres where the area allows, inside it."""
    side = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]) / _POLES
    x, y = (
        np.round(np.arange(low + side / 2, high, side)) if side >= 1 else np.arange(low + side / 2, high, side)
        for low, high in (grid.x, grid.y)
    )
    return list(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))


def _pole(canvas: Bytes, view: OverlayView, ground: AnyArray) -> None:
    heights = np.linspace(0.0, BODY_HEIGHT, 35)
    pixel = view.pixel(np.broadcast_to(ground, (len(heights), 2)), heights)
    if not np.isfinite(pixel).all():
        return
    stroke(canvas, pixel, INK, 5)
    stroke(canvas, pixel, _POLE_COLOUR, 3)
    for mark in (0.0, 0.5, 1.0, 1.5):
        disc(canvas, view.pixel(np.asarray(ground), mark), 4, _POLE_COLOUR)


def _pole_labels(canvas: Bytes, view: OverlayView, places: Sequence[Floats]) -> None:
    """Places of poles above them, from the first on; none on another."""
    labelled: list[tuple[float, float]] = []
    for ground in places:
        u, v = view.pixel(ground, BODY_HEIGHT).tolist()
        free = all(abs(u - other) > 50 or abs(v - above) > 22 for other, above in labelled)
        if free and 0 <= u < view.size[0] and 24 <= v < view.size[1]:
            chip(canvas, f"{ground[0] + 0.0:g}, {ground[1] + 0.0:g}", (u, v - 12), _POLE_COLOUR, 10)
            labelled.append((u, v))
