"""Outlines of many pillars with as many rows as each has: a near one has hundreds, most have some ten."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.bodies.outlines import Spans
from stseg.kernels.accelerate import kernel


class PackedOutlines(NamedTuple):
    """Outlines of pillars (n,) on a raster; see `stseg.bodies.outlines`.

    Attributes
    ----------
    first : int64 (n,)
        First raster row of each.
    start : int64 (n + 1,)
        First span of each; rows follow each other from the outline's first to its last.
    spans : int16 (span, 2)
        Columns from (included) to (excluded).
    area : float64 (n,)
        Pixels of the whole outline, those outside the raster included.
    inside : int64 (n,)
        Pixels of the outline on the raster.
    """

    first: Ints
    start: Ints
    spans: Spans
    area: Floats
    inside: Ints

    @classmethod
    def of(cls, parts: Iterable[tuple[Ints, Spans, Floats]]) -> Self:
        """From consecutive outlines as `outlines` returns them."""
        firsts, counts, insides = ([np.zeros(0, np.int64)] for _ in range(3))
        packed, areas = [np.zeros((0, 2), np.int16)], [np.zeros(0)]
        for first, spans, area in parts:
            rows, inside = np.empty((2, len(spans)), np.int64)
            _count(spans, rows, inside)
            kept = np.empty((int(rows.sum()), 2), np.int16)
            _pack(spans, rows, kept)
            firsts.append(first)
            counts.append(rows)
            packed.append(kept)
            areas.append(area)
            insides.append(inside)
        start = np.append(0, np.cumsum(np.concatenate(counts)))
        return cls(
            np.concatenate(firsts), start, np.concatenate(packed), np.concatenate(areas), np.concatenate(insides)
        )


@kernel
def _count(spans: Spans, rows: Ints, inside: Ints) -> None:
    """Fill rows and inside (n,) with the rows up to the last one drawn of spans (n, row, 2), and their pixels."""
    for i in range(len(spans)):
        rows[i], inside[i] = 0, 0
        for k in range(spans.shape[1]):
            if spans[i, k, 1] > 0:
                rows[i] = k + 1
                inside[i] += spans[i, k, 1] - spans[i, k, 0]


@kernel
def _pack(spans: Spans, rows: Ints, packed: Spans) -> None:
    """Fill packed (span, 2) with the first rows (n,) of spans (n, row, 2)."""
    place = 0
    for i in range(len(spans)):
        for k in range(rows[i]):
            packed[place, 0], packed[place, 1] = spans[i, k, 0], spans[i, k, 1]
            place += 1
