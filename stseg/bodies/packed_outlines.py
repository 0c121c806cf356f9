"""Outlines of many pillars with as many rows as each has: a near one has hundreds, most have some ten."""

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.bodies.outlines import Spans


class PackedOutlines(NamedTuple):
    """Outlines of pillars (n,) on a raster; see `stseg.bodies.outlines`."""

    first: Ints
    """int64 (n,): first raster row of each."""
    start: Ints
    """int64 (n + 1,): first span of each; rows follow each other from the outline's first to its last."""
    spans: Spans
    """int16 (span, 2): columns from (included) to (excluded)."""
    area: Floats
    """float64 (n,): pixels of the whole outline, those outside the raster included."""
    inside: Ints
    """int64 (n,): pixels of the outline on the raster."""

    @classmethod
    def of(cls, parts: Iterable[tuple[Ints, Spans, Floats]]) -> Self:
        """From consecutive outlines as `outlines` returns them."""
        firsts, counts, insides = ([np.zeros(0, np.int64)] for _ in range(3))
        packed, areas = [np.zeros((0, 2), np.int16)], [np.zeros(0)]
        for first, spans, area in parts:
            row, drawn = np.arange(spans.shape[1]), spans[..., 1] > 0
            rows = np.where(drawn, row + 1, 0).max(1, initial=0)
            firsts.append(first)
            counts.append(rows)
            packed.append(spans[row < rows[:, None]])
            areas.append(area)
            insides.append(np.where(drawn, spans[..., 1] - spans[..., 0], 0).sum(1, dtype=np.int64))
        start = np.append(0, np.cumsum(np.concatenate(counts)))
        return cls(
            np.concatenate(firsts), start, np.concatenate(packed), np.concatenate(areas), np.concatenate(insides)
        )
