"""Overlay of tracks on a camera's image: pillars of the people's heights, ids and trails."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Rows
from stseg.bodies.pillars import PROFILE
from stseg.geometry import Camera, Grid
from stseg.reporting.pictures.canvas import blank, chip, chip_size, disc, fading_stroke, fill, outline, stroke, text
from stseg.reporting.pictures.colours import NIGHT, PAPER, Colour, mixed, track_colour
from stseg.reporting.pictures.labels import place_labels

_COMMON_HEIGHT = 1.70  # metres, of a person of unknown height
_SUBPIXELS = 4  # sub-pixels a pixel of a pillar's outline
_CIRCLE_ANGLES = np.linspace(0, 2 * np.pi, 33)[:-1]
_LINE = mixed(NIGHT, PAPER, 0.22)


def overlay(
    camera: Camera,
    grid: Grid,
    image: Bytes | None,
    trajectory: Rows,
    frame: int,
    trail: int = 25,
    width: int = 1280,
) -> Bytes:
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

    Returns
    -------
    uint8 (v, u, 3)
        Blue, green, red.
    """
    view = OverlayView(camera, width)
    canvas = view.canvas(image)
    if image is None or image.ndim == 2:
        _rule(canvas, view, grid)
    present = trajectory[trajectory["frame"] == frame]
    recent = trajectory[(trajectory["frame"] <= frame) & (trajectory["frame"] >= frame - trail)]
    for row in present:
        _draw_trail(canvas, view, recent[recent["id"] == row["id"]], frame, trail)
    for row in present[np.argsort(-_distance(camera, present), kind="stable")]:
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
        return np.asarray(np.rint(scaled * 0.85), np.uint8)

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
    for polygon in pillar_outline(view, ground, _height(row)):
        fill(canvas, polygon, colour, 0.28)
        outline(canvas, polygon, mixed(colour, PAPER, 0.15), 2)
    foot = view.pixel(ground, 0.0)
    if np.isfinite(foot).all():
        disc(canvas, foot, 6.5, PAPER)
        disc(canvas, foot, 5, colour)


def _draw_trail(canvas: Bytes, view: OverlayView, rows: Rows, frame: int, trail: int) -> None:
    """The trail on the ground, fading with age."""
    rows = rows[np.argsort(rows["frame"], kind="stable")]
    pixel = view.pixel(np.stack([rows["x"], rows["y"]], -1), 0.0)
    colour = track_colour(int(rows["id"][0]))
    age = (frame - rows["frame"][:-1]) / max(trail, 1)
    fading_stroke(canvas, pixel, colour, 3, 1 - 0.85 * age)


def _label(canvas: Bytes, view: OverlayView, people: Rows) -> None:
    """Ids above the heads."""
    heights = np.array([_height(row) for row in people])
    heads = view.pixel(np.stack([people["x"], people["y"]], -1), heights + 0.12)
    inside = np.isfinite(heads).all(axis=1) & (heads >= 0).all(axis=1) & (heads < view.size).all(axis=1)
    heads, people = heads[inside], people[inside]
    words = [str(int(row["id"])) for row in people]
    centres = place_labels(heads, [chip_size(word, 13) for word in words], (4, 4, view.size[0] - 4, view.size[1] - 4))
    for row, word, (u, v) in zip(people, words, centres.tolist(), strict=True):
        chip(canvas, word, (u, v), track_colour(int(row["id"])), 13)


def _height(row: np.void) -> float:
    height = float(row["height"])
    return height if np.isfinite(height) and height > 0 else _COMMON_HEIGHT


def _distance(camera: Camera, rows: Rows) -> Floats:
    return np.asarray(np.hypot(rows["x"] - camera.centre[0], rows["y"] - camera.centre[1]))


def _rule(canvas: Bytes, view: OverlayView, grid: Grid) -> None:
    """The ground's metres, and its rectangle a little brighter."""
    (x0, x1), (y0, y1) = grid.x, grid.y
    along_x, along_y = np.linspace(x0, x1, 400), np.linspace(y0, y1, 400)
    for x in [*np.arange(np.ceil(x0), x1), x0, x1]:
        _ground_line(canvas, view, np.full(400, x), along_y, x in (x0, x1))
    for y in [*np.arange(np.ceil(y0), y1), y0, y1]:
        _ground_line(canvas, view, along_x, np.full(400, y), y in (y0, y1))


def _ground_line(canvas: Bytes, view: OverlayView, x: Floats, y: Floats, is_border: bool) -> None:
    colour: Colour = mixed(_LINE, PAPER, 0.3) if is_border else _LINE
    stroke(canvas, view.pixel(np.stack([x, y], -1), 0.0), colour, 2 if is_border else 1)
