"""Outlines of pillars on a raster: one span of columns a row, from the discs of `stseg.bodies.pillars`."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Floats, Ints, Shorts, Singles
from stseg.bodies.pillars import LEVELS, SILHOUETTE, BodyTable, fill_discs, fill_levels
from stseg.kernels.accelerate import kernel, part

# Innermost loops have unsigned places: whether one is negative, and counts from the end, is not asked there.

WHOLE_SHARE = 0.9
"""Share of an outline's area that lies in the image where the image's border does not cut the body."""
Spans = NDArray[np.int16]
"""int16 (..., row, 2): first and last column (exclusive) of an outline in each raster row."""


class Pillars(NamedTuple):
    """Pillars in arrays of one shape (...)."""

    ground: Floats
    """float64 (..., 2): places, metres."""
    height: Floats
    """Metres."""
    width: Floats
    """Relative to the silhouette of `stseg.bodies.pillars`."""


def outlines(
    table: BodyTable, ground: Floats, heights: Floats, step: int, shape: tuple[int, int], widths: Floats | None = None
) -> tuple[Ints, Spans, Floats]:
    """Outlines of pillars in one view.

    Parameters
    ----------
    table
        The view.
    ground : float64 (n, 2)
        Their places, metres.
    heights : float64 (n,)
        Metres.
    step
        Image pixels to a raster pixel.
    shape
        Rows and columns of the raster.
    widths : float64 (n,), optional
        Relative to the silhouette of `stseg.bodies.pillars`; 1 if not given.

    Returns
    -------
    first : int64 (n,)
        First row; -1 where the view does not see the pillar.
    spans : int16 (n, row, 2)
        Columns from (included) to (excluded) of each row from `first` on; as many rows as the tallest outline needs.
    area : float64 (n,)
        Pixels of the whole outline, those outside the raster included.
    """
    first, count = np.full(len(ground), -1, np.int64), np.zeros(len(ground), np.int64)
    area = np.zeros(len(ground))
    wide = np.ones(len(ground)) if widths is None else widths
    spans = np.zeros((len(ground), shape[0], 2), np.int16)
    place = np.ascontiguousarray(ground, float)
    _fill_outlines(table, Pillars(place, heights, wide), float(step), shape[1], first, count, spans, area)
    return first, spans[:, : max(int(count.max(initial=0)), 1)].copy(), area


@kernel
def paint_outlines(order: Ints, first: Ints, spans: Spans, assigned: Shorts) -> None:
    """Write the numbers of outlines into assigned (v, u), one after the other in an order: the last one shows."""
    for j in order:
        if first[j] >= 0:
            for k in range(min(spans.shape[1], assigned.shape[0] - first[j])):
                assigned[first[j] + k, spans[j, k, 0] : spans[j, k, 1]] = j


def sums_inside(
    table: BodyTable, pillars: Pillars, step: int, values: Singles, owner: Shorts, number: Ints
) -> tuple[Floats, Floats]:
    """Sums of a map inside outlines of pillars, several for each person: quicker than outlines that are kept.

    Parameters
    ----------
    table, step
        As for `outlines`.
    pillars
        Arrays of (person, pillar).
    values : float32 (v, u)
        On the raster.
    owner : int16 (v, u)
        Number of the person that each pixel is assigned to, -1 for none. Own and unassigned pixels count.
    number : int64 (person,)
        The number of each.

    Returns
    -------
    sums, area : float64 (person, pillar)
        Of what counts, and pixels of the whole outline; both 0 where the view does not see the pillar.
    """
    sums, area = result = np.zeros((2, *pillars.height.shape))
    _fill_sums(table, pillars, float(step), values, owner, number, result)
    return sums, area


@kernel
def _fill_sums(
    table: BodyTable, pillars: Pillars, step: float, values: Singles, owner: Shorts, number: Ints, result: Floats
) -> None:
    """Fill the sums and areas of `sums_inside`, which are 0 before."""
    people, pillar_count = pillars.height.shape
    rows, columns = values.shape
    sums, area = result[0], result[1]
    discs, drawn = np.empty((len(SILHOUETTE), 6)), np.empty((pillar_count, len(SILHOUETTE), 6))
    low, high, left_of = np.empty(rows), np.empty(rows), np.empty(rows * (columns + 1))
    levels = np.empty((len(LEVELS), 6))
    for j in range(people):
        for i in range(pillar_count):
            x, y = pillars.ground[j, i]
            if i == 0 or x != pillars.ground[j, i - 1, 0] or y != pillars.ground[j, i - 1, 1]:
                fill_levels(table, x, y, levels)
            fill_discs(levels, pillars.height[j, i], SILHOUETTE, table.step, discs)
            if _seen(discs):
                area[j, i] = _fill_drawn(discs, step, pillars.width[j, i], drawn[i])
        window = _window(drawn, area[j], rows, columns)
        _fill_left_of(values, owner, number[j], window, left_of)
        for i in range(pillar_count):
            if area[j, i] > 0:
                top, bottom = _draw(drawn[i], low, high)
                sums[j, i] = _between(left_of, window, low, high, top, bottom, columns)


@kernel
def _fill_outlines(
    table: BodyTable,
    pillars: Pillars,
    raster_step: float,
    columns: int,
    first: Ints,
    count: Ints,
    spans: Spans,
    area: Floats,
) -> None:
    rows, (discs, drawn) = spans.shape[1], np.empty((2, len(SILHOUETTE), 6))
    low, high, levels = np.empty(rows), np.empty(rows), np.empty((len(LEVELS), 6))
    for i in range(len(first)):
        fill_levels(table, pillars.ground[i, 0], pillars.ground[i, 1], levels)
        fill_discs(levels, pillars.height[i], SILHOUETTE, table.step, discs)
        if _seen(discs):
            area[i] = _fill_drawn(discs, raster_step, pillars.width[i], drawn)
            top, bottom = _draw(drawn, low, high)
            _store(low, high, top, bottom, columns, i, first, count, spans)


@part
def _window(drawn: Floats, area: Floats, rows: int, columns: int) -> tuple[int, int, int, int]:
    """Rows from and to (excluded), then columns, that hold all of the pillars' drawn discs (pillar, disc, 6).

    What joins them lies within.
    """
    top, bottom, left, right = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(drawn)):
        for k in range(drawn.shape[1] if area[i] > 0 else 0):
            u, v, wide, tall = drawn[i, k, 0], drawn[i, k, 1], drawn[i, k, 4], drawn[i, k, 5]
            top, bottom = min(top, v - tall), max(bottom, v + tall)
            left, right = min(left, u - wide), max(right, u + wide)
    if top > bottom:
        return 0, 0, 0, 0
    return _from(top, rows), _from(bottom + 2, rows), _from(left, columns), _from(right + 2, columns)


@part
def _from(place: float, most: int) -> int:
    """The pixel at or before a place, 0..most: beside a camera places lie beyond what a whole number can hold."""
    return int(min(max(place, 0.0), float(most)))


@part
def _fill_left_of(
    values: Singles, owner: Shorts, person: int, window: tuple[int, int, int, int], left_of: Floats
) -> None:
    """Fill left_of with cumulative sums along the rows of a window of a person's open pixels, one row after the other.

    They lie side by side, since memory that was not used of late is slow.
    """
    top, bottom, left, right = window
    place = np.uint64(0)
    for row in range(top, bottom):
        total, left_of[place] = 0.0, 0.0
        row_values, row_owner = values[row, left:right], owner[row, left:right]
        for u in range(len(row_values)):
            total += float(row_values[u]) if row_owner[u] < 0 or row_owner[u] == person else 0.0
            place += np.uint64(1)
            left_of[place] = total
        place += np.uint64(1)


@part
def _between(
    left_of: Floats, window: tuple[int, int, int, int], low: Floats, high: Floats, top: int, bottom: int, columns: int
) -> float:
    """Sum from column low to high (row,) of the rows from `top` to before `bottom`, from sums along a window's rows."""
    total = 0.0
    first, _, left, right = window
    for row in range(top, bottom):
        at = np.uint64(row)
        if low[at] <= high[at]:
            start, stop = _from(np.ceil(low[at]), columns), _from(np.floor(high[at]) + 1, columns)
            if start < stop:
                line = (row - first) * (right - left + 1) - left
                total += left_of[np.uint64(line + stop)] - left_of[np.uint64(line + start)]
    return total


@part
def _seen(discs: Floats) -> bool:
    """Whether the view sees all of a pillar's discs."""
    total = 0.0
    for k in range(len(discs)):
        total += discs[k, 0] + discs[k, 2] + discs[k, 3]
    return not np.isnan(total)


@part
def _fill_drawn(discs: Floats, raster_step: float, width: float, drawn: Floats) -> float:
    """Fill drawn (k, 6) with each disc's centre u, v, slope, half widths, half height; the area of the whole outline.

    Discs are taken from image pixels to the raster's, as wide as asked. The slope is that of the ellipse's middle from
    row to row, the first half width that of its middle row, the second that of its shadow on the u axis. The area is
    that of trapezoids along the pillar's axis plus half a disc at either end.
    """
    scale, shift = width / raster_step, 0.5 / raster_step - 0.5
    total, first, last = 0.0, 0.0, 0.0
    for k in range(len(discs)):
        uu, uv, vu, vv = discs[k, 2] * scale, discs[k, 3] * scale, discs[k, 4] * scale, discs[k, 5] * scale
        tall, wide = math.sqrt(vu * vu + vv * vv), math.sqrt(uu * uu + uv * uv)
        turned = abs(uu * vv - uv * vu)
        drawn[k, 0], drawn[k, 1] = discs[k, 0] / raster_step + shift, discs[k, 1] / raster_step + shift
        drawn[k, 2], drawn[k, 3] = (uu * vu + uv * vv) / (tall * tall + 1e-12), turned / (tall + 1e-12)
        drawn[k, 4], drawn[k, 5] = wide, tall
        if k > 0:
            across, down = drawn[k, 0] - drawn[k - 1, 0], drawn[k, 1] - drawn[k - 1, 1]
            total += math.sqrt(across * across + down * down) * (wide + drawn[k - 1, 4])
        first, last = first if k > 0 else turned, turned
    return max(total + 0.5 * np.pi * first + 0.5 * np.pi * last, 1.0)


@part
def _draw(drawn: Floats, low: Floats, high: Floats) -> tuple[int, int]:
    """Fill low and high (row,) with the outline's first and last column from row `top` to before `bottom`."""
    rows = len(low)
    least, most = drawn[0, 1], drawn[0, 1]
    for k in range(len(drawn)):
        least, most = min(least, drawn[k, 1] - drawn[k, 5]), max(most, drawn[k, 1] + drawn[k, 5])
    top, bottom = _from(np.ceil(least), rows), _from(np.floor(most) + 1, rows)
    low[top:bottom], high[top:bottom] = np.inf, -np.inf
    for k in range(len(drawn)):
        _widen(drawn, k, rows, low, high)
    return top, bottom


@part
def _widen(drawn: Floats, k: int, rows: int, low: Floats, high: Floats) -> None:
    """Widen the rows' spans by the k-th drawn disc, and by the trapezoid to the disc before it."""
    u, v, slope, flat, wide, tall = drawn[k, 0], drawn[k, 1], drawn[k, 2], drawn[k, 3], drawn[k, 4], drawn[k, 5]
    shrink = 1.0 / (tall + 1e-12)
    for row in range(_from(np.ceil(v - tall), rows), _from(np.floor(v + tall) + 1, rows)):
        at, away = np.uint64(row), row - v
        along = away * shrink
        middle, half = u + slope * away, flat * math.sqrt(max(1.0 - along * along, 0.0))
        low[at], high[at] = min(low[at], middle - half), max(high[at], middle + half)
    if k == 0:
        return
    u0, v0, wide0 = drawn[k - 1, 0], drawn[k - 1, 1], drawn[k - 1, 4]
    per_row = 0.0 if v == v0 else 1.0 / (v - v0)
    for row in range(_from(np.ceil(min(v, v0)), rows), _from(np.floor(max(v, v0)) + 1, rows)):
        at, share = np.uint64(row), 0.5 if v == v0 else (row - v0) * per_row
        middle, half = u0 + (u - u0) * share, wide0 + (wide - wide0) * share
        low[at], high[at] = min(low[at], middle - half), max(high[at], middle + half)


@part
def _store(
    low: Floats, high: Floats, top: int, bottom: int, columns: int, i: int, first: Ints, count: Ints, spans: Spans
) -> None:
    """Clip the rows' spans to the raster and keep those that are not empty."""
    for row in range(top, bottom):
        if low[row] > high[row]:
            continue
        start, stop = _from(np.ceil(low[row]), columns), _from(np.floor(high[row]) + 1, columns)
        if stop <= start:
            continue
        if first[i] < 0:
            first[i] = row
        spans[i, row - first[i], 0], spans[i, row - first[i], 1] = start, stop
        count[i] = row - first[i] + 1
