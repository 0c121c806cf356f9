"""When people were there: by the hour, and the busiest minutes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.reporting.charts import Span

LONG = 600.0
"""Length of a run from which its busiest minutes are shown apart, seconds."""
_MINUTE, _HOUR = 60.0, 3600.0


@dataclass(frozen=True)
class BusyTime:
    """A part of a run.

    Attributes
    ----------
    first, stop
        Its frames, half open.
    mean, most
        People at a time.
    come
        Tracks that begin in it.
    """

    first: int
    stop: int
    mean: float
    most: int
    come: int


def people_by_hour(span: Span, trajectory: Rows) -> list[BusyTime]:
    """Each hour from the beginning of the run."""
    return _parts(span, trajectory, _HOUR)


def busiest_minutes(span: Span, trajectory: Rows, most: int = 3) -> list[BusyTime]:
    """The minutes with most people, the earlier first where they are equal; in order of time."""
    minutes = _parts(span, trajectory, _MINUTE)
    busiest = sorted(minutes, key=lambda one: (-one.mean, one.first))[:most]
    return sorted((one for one in busiest if one.mean > 0), key=lambda one: one.first)


def _parts(span: Span, trajectory: Rows, seconds: float) -> list[BusyTime]:
    length = max(1, round(seconds * span.frame_rate))
    edges: Ints = np.append(np.arange(span.first, span.stop, length), span.stop)
    counts = np.bincount(trajectory["frame"] - span.first, minlength=span.stop - span.first)
    begun, _ = np.histogram(_first_frames(trajectory), edges)
    return [
        BusyTime(first, stop, float(counts_of_part.mean()), int(counts_of_part.max()), int(new))
        for first, stop, new in zip(edges[:-1].tolist(), edges[1:].tolist(), begun.tolist(), strict=True)
        if len(counts_of_part := counts[first - span.first : stop - span.first])
    ]


def _first_frames(trajectory: Rows) -> Floats:
    """First frame of each track, float64 (tracks,)."""
    order = np.lexsort((trajectory["frame"], trajectory["id"]))
    _, first = np.unique(trajectory["id"][order], return_index=True)
    return np.asarray(trajectory["frame"][order][first], float)
