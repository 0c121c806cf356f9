"""Maps of the ground: density of people, dwell time, ghosts, and coverage by the views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stseg.arrays import AnyArray, Bytes, Floats, Ints, Rows, ground_of
from stseg.geometry import Grid, Rig
from stseg.reporting.pictures.canvas import chip, chips, fill, outline, stroke, text, text_size
from stseg.reporting.pictures.colours import INK, PAPER, QUIET, Colour, Picture, mixed
from stseg.reporting.pictures.plan import draw_ground, legend_of_tones, plan_map
from stseg.reporting.pictures.plan_map import PlanMap, scale_bar, sheet

_MAX_BINS = 40  # along the longer side of the ground, at most
_BIN_SIDES = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # metres
_DWELL_RADIUS = 0.75  # radius of a dwell place, metres
_MOST_PLACES = 3
_WARM_TONES = np.array([(252, 251, 250), (150, 206, 254), (60, 140, 240), (38, 54, 190), (48, 18, 96)], float)


@dataclass(frozen=True)
class Bins:
    """Square bins of the ground."""

    x: tuple[float, float]
    y: tuple[float, float]
    """The ground rectangle, metres."""
    side: float
    """Side of a bin, metres."""

    @classmethod
    def of(cls, grid: Grid) -> Bins:
        """Bins of a round side, no finer than the cells."""
        longest = max(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0])
        fit = [side for side in _BIN_SIDES if side >= grid.cell - 1e-9 and side * _MAX_BINS >= longest]
        return cls(grid.x, grid.y, min(fit, default=longest / _MAX_BINS))

    @property
    def shape(self) -> tuple[int, int]:
        """(y, x)."""
        tall, wide = (int(np.ceil((high - low) / self.side - 1e-9)) for low, high in (self.y, self.x))
        return max(1, tall), max(1, wide)

    def index(self, rows: Rows) -> Ints:
        """The flat bin of each row, -1 outside the ground."""
        u, v = (np.floor((rows[name] - low) / self.side) for name, low in (("x", self.x[0]), ("y", self.y[0])))
        inside = (u >= 0) & (v >= 0) & (u < self.shape[1]) & (v < self.shape[0])
        return np.where(inside, v * self.shape[1] + u, -1).astype(np.int64)

    def count(self, index: Ints) -> Floats:
        """Rows in each bin, float64 (y, x)."""
        return np.bincount(index[index >= 0], minlength=self.shape[0] * self.shape[1]).reshape(self.shape).astype(float)


def density(bins: Bins, rows: Rows, frames: int) -> Floats:
    """Mean number of rows a frame and square metre, float64 (y, x): of people, or of ghosts."""
    return bins.count(bins.index(rows)) / (max(frames, 1) * bins.side**2)


def dwell(bins: Bins, trajectory: Rows, frame_rate: float) -> Floats:
    """Mean duration of a stay in each bin, seconds, float64 (y, x); 0 without stays.

    A stay is an unbroken sequence of one track's rows in one bin; a return begins another.
    """
    table = trajectory[np.lexsort((trajectory["frame"], trajectory["id"]))]
    index = bins.index(table)
    moved = (np.diff(index) != 0) | (np.diff(table["id"]) != 0)
    begins = np.concatenate([[True], moved])[: len(table)]
    stays = bins.count(index[begins])
    return np.asarray(bins.count(index) / np.maximum(stays, 1) / frame_rate, float)


@dataclass(frozen=True)
class DwellPlace:
    """A place of long stays: position in metres, and the share of all person-time spent near it."""

    x: float
    y: float
    share: float


def dwell_places(trajectory: Rows, bins: Bins) -> list[DwellPlace]:
    """Places with more person-time within `_DWELL_RADIUS` than an even spread gives, the longest first, a few at most.

    Greedy: the place with most time, then the next in the remaining time.
    """
    remaining = ground_of(trajectory)
    even = np.pi * _DWELL_RADIUS**2 / ((bins.x[1] - bins.x[0]) * (bins.y[1] - bins.y[0]))
    found: list[DwellPlace] = []
    total = max(len(remaining), 1)
    while len(remaining) and len(found) < _MOST_PLACES:
        place = _busiest(remaining, bins)
        inside = np.hypot(*(remaining - place).T) <= _DWELL_RADIUS
        share = float(inside.sum() / total)
        if share < max(0.02, 1.5 * even):
            break
        x, y = remaining[inside].mean(axis=0).tolist()
        found.append(DwellPlace(x, y, share))
        remaining = remaining[~inside]
    return found


def _busiest(places: Floats, bins: Bins) -> Floats:
    """The corner of bins around which most places lie."""
    edges = [np.arange(low, high + bins.side, bins.side) for low, high in (bins.x, bins.y)]
    counts, *_ = np.histogram2d(places[:, 0], places[:, 1], edges)
    middles = [(edge[1:] + edge[:-1]) / 2 for edge in edges]
    reach = int(_DWELL_RADIUS // bins.side)
    padded = np.pad(counts, reach)
    sums = np.zeros_like(counts)
    for u in range(2 * reach + 1):
        for v in range(2 * reach + 1):
            if (u - reach) ** 2 + (v - reach) ** 2 <= (_DWELL_RADIUS / bins.side) ** 2:
                sums += padded[u : u + counts.shape[0], v : v + counts.shape[1]]
    best = np.unravel_index(int(sums.argmax()), sums.shape)
    return np.array([middles[0][best[0]], middles[1][best[1]]])


def heat_map(rig: Rig, bins: Bins, values: Floats, title: str, units: str, marks: Sequence[DwellPlace] = ()) -> Picture:
    """Heat map of bins from above, y up: white for none, dark for much.

    Parameters
    ----------
    values : float64 (y, x)
        Zero or more; the colour scale ends at their 99th percentile.
    marks
        Places that are lettered A, B, C.
    """
    limit = float(np.percentile(values[values > 0], 99)) if (values > 0).any() else 1.0
    plan = plan_map(rig, 900, 900)
    canvas = sheet(plan, title)
    paint_bins(canvas, plan, bins, warm_colours(values, limit))
    draw_ground(canvas, plan, rig)
    for letter, mark in zip("ABC", marks, strict=False):
        u, v = plan.pixel(np.array([mark.x, mark.y])).tolist()
        chip(canvas, letter, (u, v), INK, 16)
    _ramp(canvas, plan, limit, units)
    return canvas


def blind_map(rig: Rig, views: Bytes) -> Bytes:
    """Map of the number of views that see each ground cell at some height: none red, one orange, more lighter."""
    plan = plan_map(rig, 900, 900)
    canvas = sheet(plan, "Views that see the ground")
    view_count = views.max(axis=0)
    most = max(len(rig.cameras), int(view_count.max()))
    tones = [(60, 60, 190), (120, 190, 250)]  # seen by none, by one; the more the lighter
    tones += [mixed((206, 199, 195), (252, 251, 250), (count - 1) / (most - 1)) for count in range(2, most + 1)]
    colours = np.array(tones, np.uint8)[view_count]
    colours[~rig.grid.inside()] = PAPER  # nobody is sought there
    paint_bins(canvas, plan, Bins(rig.grid.x, rig.grid.y, rig.grid.cell), colours)
    draw_ground(canvas, plan, rig)
    v = plan.size[1] - 38.0
    u = legend_of_tones(canvas, (76.0, v), tones)
    text(canvas, "views", (u + 10, v), QUIET, 15, (0, 0.5))
    scale_bar(canvas, plan, (plan.size[0] - 44.0, v))
    return canvas


def paint_bins(canvas: Bytes, plan: PlanMap, bins: Bins, colours: Bytes) -> None:
    """Paint bins uint8 (y, x, 3) onto a plan."""
    (left, top), (right, bottom) = (
        np.rint(plan.pixel(np.array(corner))).astype(int).tolist()
        for corner in ((bins.x[0], bins.y[1]), (bins.x[1], bins.y[0]))
    )
    v, u = np.arange(top, bottom), np.arange(left, right)
    y = bins.y[1] - (v - top + 0.5) / plan.scale
    x = bins.x[0] + (u - left + 0.5) / plan.scale
    row = np.clip(((y - bins.y[0]) / bins.side).astype(int), 0, colours.shape[0] - 1)
    column = np.clip(((x - bins.x[0]) / bins.side).astype(int), 0, colours.shape[1] - 1)
    canvas[top:bottom, left:right] = colours[row[:, None], column[None]]


def warm_colours(values: AnyArray, limit: float) -> Bytes:
    """White, orange, red, dark for 0 to `limit`, uint8 (..., 3)."""
    share = np.clip(np.asarray(values, float) / limit, 0, 1)
    stops = np.linspace(0, 1, len(_WARM_TONES))
    return np.asarray(np.rint(np.stack([np.interp(share, stops, tone) for tone in _WARM_TONES.T], -1)), np.uint8)


def _ramp(canvas: Bytes, plan: PlanMap, limit: float, units: str) -> None:
    """Colour bar below the map."""
    length, tall, u, v = 260, 16, 76, plan.size[1] - 52
    canvas[v : v + tall, u : u + length] = warm_colours(np.linspace(0, limit, length), limit)[None]
    corners = np.array([[u, v], [u + length, v], [u + length, v + tall], [u, v + tall]])
    outline(canvas, corners, mixed(QUIET, PAPER, 0.5))
    text(canvas, "0", (u, v + tall + 7), QUIET, 14, (0, 0))
    text(canvas, f"{limit:.2g} or more", (u + length, v + tall + 7), QUIET, 14, (0.5, 0))
    text(canvas, units, (u + length + 16, v + tall / 2), QUIET, 15, (0, 0.5))
    if u + length + 16 + text_size(units, 15)[0] < plan.size[0] - 320:
        scale_bar(canvas, plan, (plan.size[0] - 44.0, v + tall / 2))


_ZONE: Colour = (150, 110, 40)
_LINE: Colour = (60, 60, 200)


def flow_map(
    rig: Rig, field: Rows, zones: Sequence[tuple[str, Sequence[Floats]]], lines: Sequence[tuple[str, Floats]]
) -> Picture:
    """Density from above, with an arrow of the mean velocity in each busy bin.

    `field` CELL (bins,) is of `stseg.measures.motion.flow_field`; zones are names and rings, lines names and points,
    metres.
    """
    x = np.unique(field["x"])
    side = float(np.diff(x).min()) if len(x) > 1 else rig.grid.x[1] - rig.grid.x[0]
    bins = Bins(rig.grid.x, rig.grid.y, side)
    values = field["density"].reshape(bins.shape)
    canvas = heat_map(rig, bins, values, "Density and flow", "people a square metre")
    plan = plan_map(rig, 900, 900)
    for _, rings in zones:
        for ring in rings:
            outline(canvas, plan.pixel(ring), _ZONE, 2)
    for _, points in lines:
        stroke(canvas, plan.pixel(points), _LINE, 3)
    busy = field["density"] > 0.1 * max(float(field["density"].max(initial=0.0)), 1e-9)
    for row in field[busy]:
        _arrow(canvas, plan, row, side)
    named = [*((name, rings[0], _ZONE) for name, rings in zones), *((*line, _LINE) for line in lines)]
    middles = np.array([plan.pixel(points.mean(axis=0)) for _, points, _ in named]).reshape(-1, 2)
    bounds = (*plan.corner, *plan.far_corner)
    chips(canvas, middles, [name for name, *_ in named], [colour for *_, colour in named], 11, bounds, 8)
    return canvas


def _arrow(canvas: Bytes, plan: PlanMap, row: np.void, side: float) -> None:
    """An arrow of up to a bin's side: the mean velocity, 1.5 m/s or more at full length."""
    velocity = np.array([row["flow_x"], row["flow_y"]]) / max(float(row["density"]), 1e-9)
    speed = float(np.hypot(*velocity))
    if speed < 0.1:
        return
    centre, ahead = np.array([row["x"], row["y"]]), velocity / speed
    half = 0.5 * side * min(speed / 1.5, 1.0) * ahead
    tip, tail = plan.pixel(centre + half), plan.pixel(centre - half)
    way = (tip - tail) / max(float(np.hypot(*(tip - tail))), 1e-9)
    across = np.array([-way[1], way[0]])
    shaft, head = np.stack([tail, tip]), tip + np.stack([6 * way, 5 * across - 5 * way, -5 * across - 5 * way])
    stroke(canvas, shaft, PAPER, 5)
    outline(canvas, head, PAPER, 3)
    stroke(canvas, shaft, INK, 2)
    fill(canvas, head, INK)
