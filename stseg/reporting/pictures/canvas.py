"""Drawing on uint8 (v, u, 3) canvases with sub-pixel, anti-aliased strokes.

Points are float (n, 2), u to the right and v down, pixel centres at integers. A point that is nan interrupts a line.
"""

from collections.abc import Iterable, Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from stseg.arrays import AnyArray, Bytes, Flags, Floats, Ints
from stseg.reporting.pictures.colours import PAPER, Colour

MAX_LABELS = 24
"""Tracks that are labelled in a picture: the longest ones."""
_SHIFT = 4  # fractional bits of OpenCV's coordinates
_TRAIL_WIDTH = 3  # of a fading stroke, pixels
_CAPITALS = 22.0  # height in pixels of OpenCV's capitals at scale 1
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def blank(width: int, height: int, colour: Colour) -> Bytes:
    """A canvas of one colour."""
    return np.full((height, width, 3), colour, np.uint8)


def stroke(canvas: Bytes, points: AnyArray, colour: Colour, width: int = 1, opacity: float = 1.0) -> None:
    """An open polyline."""
    for run in _unbroken(points):
        if opacity >= 1:
            cv2.polylines(canvas, [_fixed(run)], False, colour, width, cv2.LINE_AA, _SHIFT)
        else:
            for mask, origin in _blended(canvas, run, width + 1, colour, opacity):
                cv2.polylines(mask, [_fixed(run - origin)], False, 255, width, cv2.LINE_AA, _SHIFT)


def dashes(canvas: Bytes, points: AnyArray, colour: Colour, width: int = 1, on: float = 7.0, off: float = 6.0) -> None:
    """An open polyline, interrupted: `on` pixels drawn, `off` pixels left out."""
    for run in _unbroken(points):
        for piece in _dashed(run, on, off):
            cv2.polylines(canvas, [_fixed(piece)], False, colour, width, cv2.LINE_AA, _SHIFT)


def fading_stroke(canvas: Bytes, points: AnyArray, colour: Colour, opacities: AnyArray) -> None:
    """An open polyline, `_TRAIL_WIDTH` wide, with an opacity for each piece, 0..1, one fewer than points."""
    points = np.asarray(points, float)
    finite: Flags = np.asarray(np.isfinite(points).all(axis=1))
    if not finite.any():
        return
    for mask, origin in _blended(canvas, points[finite], _TRAIL_WIDTH + 1, colour, 1.0):
        for k in np.flatnonzero(finite[1:] & finite[:-1]):
            piece = _fixed(points[k : k + 2] - origin)
            cv2.polylines(mask, [piece], False, round(255 * float(opacities[k])), _TRAIL_WIDTH, cv2.LINE_AA, _SHIFT)


def outline(canvas: Bytes, points: AnyArray, colour: Colour, width: int = 1) -> None:
    """A closed polygon's edge."""
    cv2.polylines(canvas, [_fixed(points)], True, colour, width, cv2.LINE_AA, _SHIFT)


def fill(canvas: Bytes, points: AnyArray, colour: Colour, opacity: float = 1.0) -> None:
    """A closed polygon's inside."""
    if opacity >= 1:
        cv2.fillPoly(canvas, [_fixed(points)], colour, cv2.LINE_AA, _SHIFT)
        return
    for mask, origin in _blended(canvas, points, 1, colour, opacity):
        cv2.fillPoly(mask, [_fixed(np.asarray(points) - origin)], 255, cv2.LINE_AA, _SHIFT)


def disc(canvas: Bytes, place: AnyArray, radius: float, colour: Colour) -> None:
    """A filled circle."""
    (u, v), r = _fixed(place).tolist(), round(radius * 2**_SHIFT)
    cv2.circle(canvas, (u, v), r, colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def text_size(words: str, size: float, weight: int = 1) -> tuple[int, int]:
    """Width and height of a line of text with capitals `size` pixels tall."""
    (width, _), _ = cv2.getTextSize(words, _FONT, size / _CAPITALS, weight)
    return width, round(size)


def text(
    canvas: Bytes,
    words: str,
    place: tuple[float, float],
    colour: Colour,
    size: float = 12.0,
    anchor: tuple[float, float] = (0.0, 1.0),
    weight: int = 1,
) -> None:
    """A line of text with its anchor at `place`; (0, 0) is its upper left corner, (1, 1) the lower right one.

    `size` is the height of capitals, pixels; `weight` is 1 for plain and 2 for bold text.
    """
    width, height = text_size(words, size, weight)
    u, v = round(place[0] - anchor[0] * width), round(place[1] + (1 - anchor[1]) * height)
    cv2.putText(canvas, words, (u, v), _FONT, size / _CAPITALS, colour, weight, cv2.LINE_AA)


def chip_size(words: str, size: float = 12.0) -> tuple[int, int]:
    """Width and height of a `chip`."""
    width, height = text_size(words, size, 2)
    return max(width + round(size), height + round(size)), height + round(size)


def chip(canvas: Bytes, words: str, centre: tuple[float, float], colour: Colour, size: float = 12.0) -> None:
    """White words on a rounded plate of colour, with a thin white rim."""
    width, height = chip_size(words, size)
    plate = _rounded(centre, width, height)
    outline(canvas, plate, PAPER, 3)
    fill(canvas, plate, colour)
    text(canvas, words, centre, PAPER, size, (0.5, 0.5), 2)


def chips(
    canvas: Bytes,
    places: AnyArray,
    words: Sequence[str],
    colours: Iterable[Colour],
    size: float,
    bounds: tuple[float, float, float, float],
    gap: float = 9.0,
) -> None:
    """A `chip` beside the first places of (n, 2); see `place_labels` for bounds, gap and further places."""
    centres = place_labels(places, [chip_size(one, size) for one in words], bounds, gap)
    for one, (u, v), colour in zip(words, centres.tolist(), colours, strict=True):
        chip(canvas, one, (u, v), colour, size)


def blend(part: Bytes, mask: Bytes, colour: Colour, opacity: float) -> None:
    """Paint a colour into part of a canvas where the mask (0..255) says so."""
    share = mask[..., None].astype(np.float32) * np.float32(opacity / 255)
    part[:] = np.rint(part + (np.array(colour, np.float32) - part) * share).astype(np.uint8)


def _fixed(points: AnyArray) -> NDArray[np.int32]:
    """OpenCV's fixed-point coordinates."""
    return np.asarray(np.rint(np.asarray(points, float) * 2**_SHIFT), np.int32)


def _unbroken(points: AnyArray) -> Iterator[Floats]:
    """Unbroken parts of a line between its nans, of two points or more."""
    points = np.asarray(points, float)
    finite = np.isfinite(points).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], finite, [False]]).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2):
        if stop - start > 1:
            yield points[start:stop]


def _dashed(run: Floats, on: float, off: float) -> Iterator[Floats]:
    """Pieces of a polyline, `on` long and `off` apart along it."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(run, axis=0).T))])
    for start in np.arange(0.0, along[-1], on + off):
        stop = min(start + on, along[-1])
        inner = along[(along > start) & (along < stop)]
        at = np.concatenate([[start], inner, [stop]])
        yield np.stack([np.interp(at, along, run[:, 0]), np.interp(at, along, run[:, 1])], -1)


def _blended(
    canvas: Bytes, points: AnyArray, margin: int, colour: Colour, opacity: float
) -> Iterator[tuple[Bytes, Ints]]:
    """The mask of the part of a canvas around points, if any, and where it begins (u, v): what is drawn is blended."""
    points = np.asarray(points, float)
    limit = np.array([canvas.shape[1], canvas.shape[0]])
    low = np.clip(np.floor(points.min(axis=0)) - margin, 0, limit).astype(int)
    high = np.clip(np.ceil(points.max(axis=0)) + margin + 1, 0, limit).astype(int)
    part = canvas[low[1] : high[1], low[0] : high[0]]
    if part.size:
        mask = np.zeros(part.shape[:2], np.uint8)
        yield mask, low
        blend(part, mask, colour, opacity)


def _rounded(centre: tuple[float, float], width: float, height: float) -> Floats:
    """A rectangle with quarter circles for corners, float64 (n, 2)."""
    radius = 0.38 * min(width, height)
    angle = np.linspace(0, np.pi / 2, 8)
    corners = []
    for k, (right, down) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        middle = np.array([right * (width / 2 - radius), down * (height / 2 - radius)])
        turned = angle + k * np.pi / 2
        corners.append(middle + radius * np.stack([np.cos(turned), np.sin(turned)], -1))
    return np.concatenate(corners) + centre


_DIRECTIONS = np.array([(1, -1), (-1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (-1, 0), (0, 1)], float)


def place_labels(
    points: AnyArray, sizes: Sequence[tuple[int, int]], bounds: tuple[float, float, float, float], gap: float = 9.0
) -> Floats:
    """Place labels beside their points greedily, in the given order.

    Parameters
    ----------
    points : float64 (n, 2)
        Labelled points, then others that labels keep clear of, pixels.
    sizes
        Width and height of each label, pixels.
    bounds
        left, top, right, bottom of the canvas, pixels.
    gap
        Distance from a point to its label, pixels.

    Returns
    -------
    float64 (label, 2)
    """
    points = np.asarray(points, float).reshape(-1, 2)
    occupied = np.concatenate([points - 5, points + 5], axis=1)
    centres = np.zeros((len(sizes), 2))
    for k, (point, size) in enumerate(zip(points, sizes, strict=False)):
        half = np.array(size, float) / 2
        offered = point + _DIRECTIONS * (half + gap * np.where(_DIRECTIONS.all(axis=1), 0.5, 1.0)[:, None])
        offered = np.clip(offered, np.array(bounds[:2]) + half, np.array(bounds[2:]) - half)
        boxes = np.concatenate([offered - half, offered + half], axis=1)
        best = int(np.argmin(_overlap(boxes, occupied)))
        centres[k] = offered[best]
        occupied = np.concatenate([occupied, boxes[best : best + 1]])
    return centres


def _overlap(boxes: Floats, occupied: Floats) -> Floats:
    """Occupied area of each box, square pixels, float64 (n,)."""
    low = np.maximum(boxes[:, None, :2], occupied[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], occupied[None, :, 2:])
    return np.asarray(np.prod(np.clip(high - low, 0, None), axis=-1).sum(axis=1))
