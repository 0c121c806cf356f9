"""Segments: the parts of a long recording that are processed independently, and committed to disk one by one.

A segment is a whole number of windows. It has a warm-up before its first frame, so that its tracks exist by then, and
processes frames until its last window is solved. Its result depends on the recording and the configuration alone, so it
is the same after a killed run, from another process, and on another machine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from math import ceil
from typing import NamedTuple

import numpy as np

from stseg.arrays import Flags
from stseg.config import Config, TrackingConfig
from stseg.tracking.windows import window_length

_SHORTEST = 3
"""A half of a short recording is no shorter than a segment divided by this: its warm-up would cost too much."""


@dataclass(frozen=True)
class Segment:
    """Frames of the recording.

    Attributes
    ----------
    index
        Counted from 0 at the run's first.
    lead
        The first frame that is processed; the frames from there to `first` are the warm-up.
    first, stop
        The frames that are committed, half open; those of all segments partition the run, but for its gaps.
    """

    index: int
    lead: int
    first: int
    stop: int


def segments(
    frame_rate: float, config: Config, first: int, stop: int, gaps: Sequence[tuple[int, int]] = ()
) -> list[Segment]:
    """The segments that cover frames first .. stop - 1 but for gaps; they begin where commit ranges of windows do.

    Frames left at the end, and before a gap, belong to the last segment if they are no more than a window. Less than
    two segments are halved if each half is a third of a segment at least. After a gap all begins anew, as at the
    beginning of a run: neither a segment nor its warm-up reaches over one.

    Parameters
    ----------
    frame_rate
        Frames per second.
    config
        How long segments and windows are.
    first, stop
        The frames of the run, half open.
    gaps
        Frames that no camera shows, half open, in their order, within the run (`find_gaps`).
    """
    begins, ends = [first, *(end for _, end in gaps)], [*(begin for begin, _ in gaps), stop]
    parts = [part for begin, end in zip(begins, ends, strict=True) for part in _parts(frame_rate, config, begin, end)]
    return [replace(part, index=k) for k, part in enumerate(parts)]


def longest_absence(config: TrackingConfig) -> float:
    """Longest time without detections over which a track is continued, linked or interpolated, seconds."""
    return max(config.patience, config.maximum_gap, config.interpolation_gap)


def find_gaps(seen: Flags, first: int, stop: int, longest: float) -> list[tuple[int, int]]:
    """Where no camera shows anything for longer than so many frames: half-open ranges of frames first .. stop - 1.

    Parameters
    ----------
    seen : bool (camera, frame)
        Which frames each camera shows.
    """
    blind = np.concatenate([[False], ~seen[:, first:stop].any(axis=0), [False]])
    edges = first + np.flatnonzero(np.diff(blind.astype(np.int8)))
    return [(begin, end) for begin, end in edges.reshape(-1, 2).tolist() if end - begin > longest]


def _parts(frame_rate: float, config: Config, first: int, stop: int) -> list[Segment]:
    """The segments of frames in which no gap lies; none of none."""
    if first == stop:
        return []
    if (middle := _middle(frame_rate, config, first, stop)) is not None:
        lead = max(first, middle - _lengths(frame_rate, config).warm_up)
        return [Segment(0, first, first, middle), Segment(1, lead, middle, stop)]
    found: list[Segment] = []
    for segment in endless_segments(frame_rate, config, first):
        if segment.stop >= stop - window_length(frame_rate, config.tracking)[0]:
            return [*found, replace(segment, stop=stop)]
        found.append(segment)
    raise AssertionError("segments without an end ended")


class _Lengths(NamedTuple):
    """Frames between commits of windows, of a segment, and of its warm-up; and the first commit after frame 0."""

    stride: int
    segment: int
    warm_up: int
    offset: int


def _lengths(frame_rate: float, config: Config) -> _Lengths:
    length, shared = window_length(frame_rate, config.tracking)
    stride = length - shared
    segment = max(1, round(config.segments.length * frame_rate / stride)) * stride
    return _Lengths(stride, segment, ceil(config.segments.warm_up * frame_rate / stride) * stride, shared // 2)


def _middle(frame_rate: float, config: Config, first: int, stop: int) -> int | None:
    """Where frames that are fewer than two segments are divided; None where the halves would be too short.

    Two segments of one length keep two processes busy, for as many frames of warm-up as any other division.
    """
    lengths, half = _lengths(frame_rate, config), (stop - first) // 2
    least = max(lengths.segment // _SHORTEST, 2 * window_length(frame_rate, config.tracking)[0])
    if half < least or half >= lengths.segment:
        return None
    return (first + half - lengths.offset) // lengths.stride * lengths.stride + lengths.offset


def endless_segments(frame_rate: float, config: Config, first: int, index: int = 0) -> Iterator[Segment]:
    """The segments of a run whose end nobody knows yet, numbered from `index`.

    One of them is to be left open until a window's frames have come after it: if they do not come it is the last, and
    what came belongs to it.
    """
    lengths = _lengths(frame_rate, config)
    begin = lead = first
    for bound in count(lengths.segment + lengths.offset, lengths.segment):
        if bound > begin:
            yield Segment(index, lead, begin, bound)
            index, begin, lead = index + 1, bound, max(first, bound - lengths.warm_up)
