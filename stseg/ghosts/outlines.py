"""Outlines of pillars on a raster: one span of columns a row, from the discs of `geometry.bodies`."""

from __future__ import annotations

import math

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.geometry.bodies import LEVELS, SILHOUETTE, BodyTable, fill_discs
from stseg.ghosts.evidence import Spans

_BETWEEN = 3
"""Discs that are drawn for each step of the profile."""


def outlines(
    table: BodyTable, ground: Floats, heights: Floats, step: int, shape: tuple[int, int], widths: Floats | None = None
) -> tuple[Ints, Spans, Floats]:
    """Outlines of pillars in one view.

    Parameters
    ----------
    table
        The view.
    ground : float64 (n, 2)
        Where they stand, metres.
    heights : float64 (n,)
        How tall each is, metres.
    step
        Image pixels to a raster pixel.
    shape
        Rows and columns of the raster.
    widths : float64 (n,), optional
        How wide each is beside the silhouette of `geometry.bodies`; 1 if not given.

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
    lattice = _lattice(table, ground)
    spans = np.zeros((len(ground), shape[0], 2), np.int16)
    _fill_outlines(
        table.pixel, lattice, heights, wide, LEVELS[1], table.step, SILHOUETTE, float(step), shape[1], first, count,
        spans, area,
    )  # fmt: skip
    return first, spans[:, : max(int(count.max(initial=0)), 1)].copy(), area


def sums_inside(
    table: BodyTable, ground: Floats, heights: Floats, widths: Floats, step: int, values: Singles, counted: Flags
) -> tuple[Floats, Floats]:
    """Sums of a map inside the outlines of pillars: quicker than outlines where nobody else asks for those.

    Parameters
    ----------
    table, ground, heights, widths, step
        As for `outlines`.
    values : float32 (v, u)
        On the raster.
    counted : bool (v, u)
        Which of its pixels count.

    Returns
    -------
    sums, area : float64 (n,)
        Of what counts, and pixels of the whole outline; both 0 where the view does not see the pillar.
    """
    sums, area = np.zeros(len(ground)), np.zeros(len(ground))
    lattice = _lattice(table, ground)
    _fill_sums(
        table.pixel, lattice, heights, widths, LEVELS[1], table.step, SILHOUETTE, float(step), values, counted, sums,
        area,
    )  # fmt: skip
    return sums, area


def _lattice(table: BodyTable, ground: Floats) -> Floats:
    """Ground points in steps of the table's lattice."""
    return np.asarray((np.asarray(ground, float).reshape(-1, 2) - table.origin) / table.step)


@kernel
def _fill_outlines(
    pixel: Singles,
    lattice: Floats,
    heights: Floats,
    widths: Floats,
    level_step: float,
    step: float,
    profile: Floats,
    raster_step: float,
    columns: int,
    first: Ints,
    count: Ints,
    spans: Spans,
    area: Floats,
) -> None:
    rows = spans.shape[1]
    discs, drawn = np.empty((len(profile), 6)), np.empty(((len(profile) - 1) * _BETWEEN + 1, 6))
    low, high = np.empty(rows), np.empty(rows)
    for i in range(len(lattice)):
        fill_discs(pixel, lattice[i, 0], lattice[i, 1], heights[i], level_step, step, profile, discs)
        if not _seen(discs):
            continue
        area[i] = _to_raster(discs, raster_step, widths[i])
        top, bottom = _draw(discs, drawn, low, high)
        _store(low, high, top, bottom, columns, i, first, count, spans)


@kernel
def _fill_sums(
    pixel: Singles,
    lattice: Floats,
    heights: Floats,
    widths: Floats,
    level_step: float,
    step: float,
    profile: Floats,
    raster_step: float,
    values: Singles,
    counted: Flags,
    sums: Floats,
    area: Floats,
) -> None:
    rows, columns = values.shape
    discs, drawn = np.empty((len(profile), 6)), np.empty(((len(profile) - 1) * _BETWEEN + 1, 6))
    low, high = np.empty(rows), np.empty(rows)
    for i in range(len(lattice)):
        fill_discs(pixel, lattice[i, 0], lattice[i, 1], heights[i], level_step, step, profile, discs)
        if not _seen(discs):
            continue
        area[i] = _to_raster(discs, raster_step, widths[i])
        top, bottom = _draw(discs, drawn, low, high)
        total = 0.0
        for row in range(top, bottom):
            if low[row] <= high[row]:
                for u in range(max(int(np.ceil(low[row])), 0), min(int(np.floor(high[row])) + 1, columns)):
                    if counted[row, u]:
                        total += float(values[row, u])
        sums[i] = total


@kernel
def _seen(discs: Floats) -> bool:
    """Whether the view sees all of a pillar's discs."""
    total = 0.0
    for disc in discs:
        total += disc[0] + disc[2] + disc[3]
    return not np.isnan(total)


@kernel
def _to_raster(discs: Floats, raster_step: float, width: float) -> float:
    """Take discs from image pixels to the raster's, as wide as asked; the area of the whole outline."""
    for disc in discs:
        for axis in range(2):
            disc[axis] = disc[axis] / raster_step + (0.5 / raster_step - 0.5)
        for side in range(2, 6):
            disc[side] *= width / raster_step
    return float(_whole_area(discs))


@kernel
def _draw(discs: Floats, drawn: Floats, low: Floats, high: Floats) -> tuple[int, int]:
    """Fill low and high (row,) with the outline's first and last column from row `top` to before `bottom`."""
    rows = len(low)
    _fill_drawn(discs, drawn)
    least, most = drawn[0, 1], drawn[0, 1]
    for k in range(len(drawn)):
        least, most = min(least, drawn[k, 1] - drawn[k, 5]), max(most, drawn[k, 1] + drawn[k, 5])
    top, bottom = min(max(int(np.ceil(least)), 0), rows), max(min(int(np.floor(most)) + 1, rows), 0)
    low[top:bottom], high[top:bottom] = np.inf, -np.inf
    for k in range(len(drawn)):
        _widen(drawn, k, rows, low, high)
    return top, bottom


@kernel
def _fill_drawn(discs: Floats, drawn: Floats) -> None:
    """Fill drawn (k, 6) with the discs of the profile and those between: centre u, v, slope, half widths, half height.

    The slope is that of the ellipse's middle from row to row, the first half width that of its middle row, the second
    that of its shadow on the u axis.
    """
    for k in range(len(drawn)):
        lower = min(k // _BETWEEN, len(discs) - 2)
        share = (k - lower * _BETWEEN) / _BETWEEN
        u, v = _mixed(discs, lower, share, 0), _mixed(discs, lower, share, 1)
        uu, uv = _mixed(discs, lower, share, 2), _mixed(discs, lower, share, 3)
        vu, vv = _mixed(discs, lower, share, 4), _mixed(discs, lower, share, 5)
        tall = math.sqrt(vu * vu + vv * vv)
        drawn[k, 0], drawn[k, 1] = u, v
        drawn[k, 2] = (uu * vu + uv * vv) / (tall * tall + 1e-12)
        drawn[k, 3] = abs(uu * vv - uv * vu) / (tall + 1e-12)
        drawn[k, 4], drawn[k, 5] = math.sqrt(uu * uu + uv * uv), tall


@kernel
def _mixed(discs: Floats, lower: int, share: float, which: int) -> float:
    """Component `which` of a disc between two of the profile."""
    return float(discs[lower, which] * (1.0 - share) + discs[lower + 1, which] * share)


@kernel
def _widen(drawn: Floats, k: int, rows: int, low: Floats, high: Floats) -> None:
    """Widen the rows' spans by the k-th drawn disc, and by the trapezoid to the disc before it."""
    u, v, slope, flat, wide, tall = drawn[k, 0], drawn[k, 1], drawn[k, 2], drawn[k, 3], drawn[k, 4], drawn[k, 5]
    for row in range(max(int(np.ceil(v - tall)), 0), min(int(np.floor(v + tall)) + 1, rows)):
        middle, along = u + slope * (row - v), (row - v) / (tall + 1e-12)
        half = flat * math.sqrt(max(1.0 - along * along, 0.0))
        low[row], high[row] = min(low[row], middle - half), max(high[row], middle + half)
    if k == 0:
        return
    u0, v0, wide0 = drawn[k - 1, 0], drawn[k - 1, 1], drawn[k - 1, 4]
    for row in range(max(int(np.ceil(min(v, v0))), 0), min(int(np.floor(max(v, v0))) + 1, rows)):
        share = 0.5 if v == v0 else (row - v0) / (v - v0)
        middle, half = u0 + (u - u0) * share, wide0 + (wide - wide0) * share
        low[row], high[row] = min(low[row], middle - half), max(high[row], middle + half)


@kernel
def _whole_area(discs: Floats) -> float:
    """Pixels of the outline as trapezoids along its axis plus half a disc at either end."""
    total = 0.0
    before = 0.0
    for k in range(len(discs)):
        wide = math.sqrt(discs[k, 2] * discs[k, 2] + discs[k, 3] * discs[k, 3])
        if k > 0:
            across, down = discs[k, 0] - discs[k - 1, 0], discs[k, 1] - discs[k - 1, 1]
            total += math.sqrt(across * across + down * down) * (wide + before)
        before = wide
    for k in (0, len(discs) - 1):
        total += 0.5 * np.pi * abs(discs[k, 2] * discs[k, 5] - discs[k, 3] * discs[k, 4])
    return max(total, 1.0)


@kernel
def _store(
    low: Floats, high: Floats, top: int, bottom: int, columns: int, i: int, first: Ints, count: Ints, spans: Spans
) -> None:
    """Clip the rows' spans to the raster and keep those that are not empty."""
    for row in range(top, bottom):
        if low[row] > high[row]:
            continue
        start = max(int(np.ceil(low[row])), 0)
        stop = min(int(np.floor(high[row])) + 1, columns)
        if stop <= start:
            continue
        if first[i] < 0:
            first[i] = row
        spans[i, row - first[i], 0], spans[i, row - first[i], 1] = start, stop
        count[i] = row - first[i] + 1
