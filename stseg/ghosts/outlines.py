"""Outlines of pillars on a raster: one span of columns a row, from the discs of `geometry.bodies`."""

from __future__ import annotations

import numpy as np

from stseg.accelerate import kernel
from stseg.arrays import Floats, Ints, Singles
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
    lattice = (np.asarray(ground, float).reshape(-1, 2) - table.origin) / table.step
    spans = np.zeros((len(ground), shape[0], 2), np.int16)
    _fill_outlines(
        table.pixel, lattice, heights, wide, LEVELS[1], table.step, SILHOUETTE, float(step), shape[1], first, count,
        spans, area,
    )  # fmt: skip
    return first, spans[:, : max(int(count.max(initial=0)), 1)].copy(), area


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
    discs = np.empty((len(profile), 6))
    low, high = np.empty(rows), np.empty(rows)
    for i in range(len(lattice)):
        fill_discs(pixel, lattice[i, 0], lattice[i, 1], heights[i], level_step, step, profile, discs)
        discs /= raster_step
        discs[:, :2] += 0.5 / raster_step - 0.5
        discs[:, 2:] *= widths[i]
        if np.isnan(discs.sum()):
            continue
        low[:], high[:] = np.inf, -np.inf
        for k in range((len(profile) - 1) * _BETWEEN + 1):
            _widen(discs, k, rows, low, high)
        area[i] = _whole_area(discs)
        _store(low, high, columns, i, first, count, spans)


@kernel
def _between(discs: Floats, k: int, which: int) -> float:
    """Component `which` of the k-th drawn disc, interpolated along the profile."""
    lower = min(k // _BETWEEN, len(discs) - 2)
    share = (k - lower * _BETWEEN) / _BETWEEN
    return float(discs[lower, which] * (1.0 - share) + discs[lower + 1, which] * share)


@kernel
def _widen(discs: Floats, k: int, rows: int, low: Floats, high: Floats) -> None:
    """Widen the rows' spans by the k-th drawn disc, and by the trapezoid to the disc before it."""
    u, v = _between(discs, k, 0), _between(discs, k, 1)
    uu, uv = _between(discs, k, 2), _between(discs, k, 3)
    vu, vv = _between(discs, k, 4), _between(discs, k, 5)
    wide, tall = np.hypot(uu, uv), np.hypot(vu, vv)
    slope = (uu * vu + uv * vv) / (tall * tall + 1e-12)
    flat = abs(uu * vv - uv * vu) / (tall + 1e-12)
    for row in range(max(int(np.ceil(v - tall)), 0), min(int(np.floor(v + tall)) + 1, rows)):
        middle = u + slope * (row - v)
        half = flat * np.sqrt(max(1.0 - ((row - v) / (tall + 1e-12)) ** 2, 0.0))
        low[row], high[row] = min(low[row], middle - half), max(high[row], middle + half)
    if k == 0:
        return
    u0, v0 = _between(discs, k - 1, 0), _between(discs, k - 1, 1)
    wide0 = np.hypot(_between(discs, k - 1, 2), _between(discs, k - 1, 3))
    for row in range(max(int(np.ceil(min(v, v0))), 0), min(int(np.floor(max(v, v0))) + 1, rows)):
        share = 0.5 if v == v0 else (row - v0) / (v - v0)
        middle, half = u0 + (u - u0) * share, wide0 + (wide - wide0) * share
        low[row], high[row] = min(low[row], middle - half), max(high[row], middle + half)


@kernel
def _whole_area(discs: Floats) -> float:
    """Pixels of the outline as trapezoids along its axis plus half a disc at either end."""
    total = 0.0
    for k in range(1, len(discs)):
        along = np.hypot(discs[k, 0] - discs[k - 1, 0], discs[k, 1] - discs[k - 1, 1])
        total += along * (np.hypot(discs[k, 2], discs[k, 3]) + np.hypot(discs[k - 1, 2], discs[k - 1, 3]))
    for k in (0, len(discs) - 1):
        total += 0.5 * np.pi * abs(discs[k, 2] * discs[k, 5] - discs[k, 3] * discs[k, 4])
    return max(total, 1.0)


@kernel
def _store(low: Floats, high: Floats, columns: int, i: int, first: Ints, count: Ints, spans: Spans) -> None:
    """Clip the rows' spans to the raster and keep those that are not empty."""
    for row in range(len(low)):
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
