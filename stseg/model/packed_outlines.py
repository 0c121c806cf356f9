"""Outlines of many pillars with as many rows as each has: a near one has hundreds, most have some ten."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.model.outlines import Spans


class PackedOutlines(NamedTuple):
    """Outlines of pillars (n,) on a raster; see `stseg.model.outlines`.

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
    """

    first: Ints
    start: Ints
    spans: Spans
    area: Floats

    @classmethod
    def of(cls, parts: Iterable[tuple[Ints, Spans, Floats]]) -> Self:
        """From consecutive outlines as `outlines` returns them."""
        firsts, counts, packed, areas = [], [], [], []
        for first, spans, area in parts:
            drawn = spans[:, ::-1, 1] > 0
            rows = np.where(drawn.any(1), drawn.shape[1] - drawn.argmax(1), 0)
            firsts.append(first)
            counts.append(rows)
            packed.append(spans[np.arange(spans.shape[1]) < rows[:, None]])
            areas.append(area)
        start = np.append(0, np.cumsum(np.concatenate(counts)))
        return cls(np.concatenate(firsts), start, np.concatenate(packed), np.concatenate(areas))
