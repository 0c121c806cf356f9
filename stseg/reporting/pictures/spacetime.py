"""The space-time picture: the ground below, time upwards, every track a thread (Khan and Shah 2009, section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stseg.arrays import Bytes, Floats, Rows, by_track
from stseg.geometry import Grid
from stseg.reporting.pictures.canvas import MAX_LABELS, blank, chips, disc, fill, outline, stroke, text
from stseg.reporting.pictures.colours import INK, PAPER, QUIET, RULE, Picture, mixed, track_colour
from stseg.reporting.pictures.plan_map import step_for

_AZIMUTH, _ELEVATION = np.radians(-32.0), np.radians(32.0)
_MARGIN, _PIECE_POINTS, _MAX_PIECES = 88, 6, 6000


def spacetime_picture(
    grid: Grid, trajectory: Rows, frame_rate: float, title: str = "", width: int = 1200, height: int = 1400
) -> Picture:
    """Draw tracks as threads that rise with time; near ones pass in front of far ones.

    The ground rectangle is at the bottom, TRAJECTORY (n,) above, the title on top; the upright axis is labelled in
    seconds, by the frames per second. The size is in pixels.
    """
    canvas = blank(width, height, PAPER)
    text(canvas, title, (40, 30), INK, 20, (0, 0), 2)
    frames = trajectory["frame"]
    first, last = (int(frames.min()), int(frames.max())) if len(frames) else (0, 1)
    block = Block.fit(grid, first, max(last, first + 1), (width, height))
    _draw_floor(canvas, block)
    _draw_clock(canvas, block, frame_rate)
    threads = _threads(trajectory)
    for thread in threads:
        floor = np.column_stack([thread.places[:, :2], np.full(len(thread.places), first)])
        stroke(canvas, block.pixel(floor), mixed(QUIET, PAPER, 0.45), 1)
    _draw_threads(canvas, block, threads)
    _label(canvas, block, threads)
    return canvas


@dataclass(frozen=True)
class Block:
    """A parallel projection of the ground (metres) and time (frames)."""

    x: tuple[float, float]
    y: tuple[float, float]
    """The ground rectangle, metres."""
    time: tuple[int, int]
    """First and last frame."""
    matrix: Floats
    """float64 (3, 3): x, y, frame to u, v and the distance from the eye."""
    origin: Floats
    """float64 (2,): pixel of x = 0, y = 0, frame 0."""

    @classmethod
    def fit(cls, grid: Grid, first: int, last: int, size: tuple[int, int]) -> Block:
        """The largest block on a canvas of that size, as tall as the ground is wide."""
        side = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
        sine, cosine = np.sin(_AZIMUTH), np.cos(_AZIMUTH)
        low, high = np.sin(_ELEVATION), np.cos(_ELEVATION)
        rise = side / (last - first)
        matrix = np.array(
            [
                [cosine, -sine, 0.0],
                [-sine * low, -cosine * low, -rise * high],
                [sine * high, cosine * high, -rise * low],
            ]
        )
        corners = np.array([[x, y, t] for x in grid.x for y in grid.y for t in (first, last)], float) @ matrix[:2].T
        space = np.array(size, float) - 2 * _MARGIN
        scale = float((space / np.ptp(corners, axis=0)).min())
        middle = scale * (corners.min(axis=0) + corners.max(axis=0)) / 2
        origin = np.array([size[0] / 2, size[1] / 2 + 18]) - middle
        return cls(grid.x, grid.y, (first, last), scale * matrix, origin)

    def pixel(self, places: ArrayLike) -> Floats:
        """Pixels of x, y (metres), frame: float64 (..., 2)."""
        return np.asarray(np.asarray(places, float) @ self.matrix[:2].T + self.origin)

    def distance(self, places: ArrayLike) -> Floats:
        """Distance from the eye, up to a constant, float64 (...)."""
        return np.asarray(np.asarray(places, float) @ self.matrix[2])

    @property
    def scale(self) -> float:
        """Pixels a metre along the axis that is shortened less."""
        return float(np.linalg.norm(self.matrix[:2, :2], axis=0).max())


@dataclass(frozen=True)
class _Thread:
    identity: int
    places: Floats
    """x, y, frame in order of time, float64 (n, 3)."""
    width: int


def _threads(trajectory: Rows) -> list[_Thread]:
    tracks, threads = by_track(trajectory), []
    width = 3 if len(tracks) <= 12 else 2 if len(tracks) <= 60 else 1
    # A picture shows no more points than that, however long the recording.
    stride = max(1, len(trajectory) // (_PIECE_POINTS * _MAX_PIECES))
    for rows in tracks:
        kept = np.unique(np.append(np.arange(0, len(rows), stride), len(rows) - 1))
        places = np.stack([rows["x"], rows["y"], rows["frame"]], -1).astype(float)[kept]
        threads.append(_Thread(int(rows["id"][0]), places, width))
    return threads


def _draw_floor(canvas: Bytes, block: Block) -> None:
    (x0, x1), (y0, y1), first = block.x, block.y, block.time[0]
    floor = block.pixel([[x0, y0, first], [x1, y0, first], [x1, y1, first], [x0, y1, first]])
    fill(canvas, floor, (249, 248, 247))
    step = step_for(block.scale, 14, 1.0)
    for x in np.arange(np.ceil(x0 / step) * step, x1 + 1e-9, step):
        stroke(canvas, block.pixel([[x, y0, first], [x, y1, first]]), RULE)
    for y in np.arange(np.ceil(y0 / step) * step, y1 + 1e-9, step):
        stroke(canvas, block.pixel([[x0, y, first], [x1, y, first]]), RULE)
    outline(canvas, floor, mixed(INK, PAPER, 0.35), 2)
    label_step = step_for(block.scale, 70, step)
    away = block.pixel([0, -1, 0]) - block.pixel([0, 0, 0])
    for x in np.arange(np.ceil(x0 / label_step) * label_step, x1 + 1e-9, label_step):
        u, v = (block.pixel([x, y0, first]) + away / np.hypot(*away) * 26).tolist()
        text(canvas, f"{x + 0.0:g}", (u, v), QUIET, 15, (0.5, 0.5))
    away = block.pixel([1, 0, 0]) - block.pixel([0, 0, 0])
    for y in np.arange(np.ceil(y0 / label_step) * label_step, y1 + 1e-9, label_step):
        u, v = (block.pixel([x1, y, first]) + away / np.hypot(*away) * 26).tolist()
        text(canvas, f"{y + 0.0:g}", (u, v), QUIET, 15, (0.5, 0.5))


def _draw_clock(canvas: Bytes, block: Block, frame_rate: float) -> None:
    """The upright axis at the leftmost corner, seconds from the recording's start; faint frames at its marks."""
    (x0, x1), (y0, y1), (first, last) = block.x, block.y, block.time
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    pixels = block.pixel(np.column_stack([corners, np.full(4, first)]))
    left = corners[int(np.argmin(pixels[:, 0]))]
    stroke(canvas, block.pixel([[*left, first], [*left, last]]), mixed(INK, PAPER, 0.35), 2)
    least = (last - first) / frame_rate / 6  # the step is the next larger of 1, 2, 5 times a power of ten
    power = 10.0 ** np.floor(np.log10(least))
    step = float(power * min(k for k in (1, 2, 5, 10) if k * power >= least * (1 - 1e-9)))
    for second in np.arange(np.ceil(first / frame_rate / step) * step, last / frame_rate + 1e-9, step):
        frame = second * frame_rate
        outline(canvas, block.pixel(np.column_stack([corners, np.full(4, frame)])), mixed(RULE, PAPER, 0.4))
        u, v = block.pixel([*left, frame]).tolist()
        stroke(canvas, np.array([[u - 6, v], [u, v]]), INK)
        text(canvas, f"{second + 0.0:g} s", (u - 12, v), QUIET, 15, (1, 0.5))


def _draw_threads(canvas: Bytes, block: Block, threads: list[_Thread]) -> None:
    """Far pieces first, each in a white casing, so that crossings read as in front and behind."""
    pieces = []
    for thread in threads:
        for start in range(0, len(thread.places) - 1, _PIECE_POINTS):
            places = thread.places[start : start + _PIECE_POINTS + 1]
            pieces.append((float(block.distance(places).mean()), thread, block.pixel(places)))
    for _, thread, pixel in sorted(pieces, key=lambda piece: -piece[0]):
        if thread.width > 2:
            stroke(canvas, pixel[1:-1], PAPER, thread.width + 3)
        stroke(canvas, pixel, track_colour(thread.identity), thread.width)
    for thread in threads:
        for end, radius in ((0, 5.0), (-1, 4.0)):
            disc(canvas, block.pixel(thread.places[end]), radius, track_colour(thread.identity))


def _label(canvas: Bytes, block: Block, threads: list[_Thread]) -> None:
    """Ids at the upper ends; of many threads only the longest."""
    longest = sorted(threads, key=lambda thread: -len(thread.places))[:MAX_LABELS]
    ends = np.array([block.pixel(thread.places[-1]) for thread in longest]).reshape(-1, 2)
    ids, (tall, wide) = [thread.identity for thread in longest], canvas.shape[:2]
    chips(canvas, ends, [*map(str, ids)], map(track_colour, ids), 14, (4, 4, wide - 4, tall - 4))
