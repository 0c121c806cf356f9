"""Segmentation of a long recording in time, into parts that are processed independently and written one by one.

A segment is a whole number of windows. Processing begins with a warm-up before its first frame, to initialise the
tracks, and continues until its last window is solved. The result depends on the recording, the configuration and the
views that are excluded before; it is the same after an interrupted run, in another process, and on another machine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from math import ceil
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.config import Config, TrackingConfig
from stseg.tracking.windows.windows import window_length
from stseg.view_health.hand_over import NO_EXCLUDED_VIEWS, SegmentStart

_SHORTEST = 3
"""Length of a segment over that of the least half of a short recording: a shorter one costs too much warm-up."""


@dataclass(frozen=True)
class Segment:
    """A range of frames of the recording with its warm-up."""

    index: int
    """Number of the segment in the run, from 0."""
    lead: int
    """First processed frame; frames lead .. first - 1 are the warm-up."""
    first: int
    stop: int
    """Committed frames, half open; those of all segments partition the run except for its gaps."""
    excluded: Rows = field(default_factory=lambda: NO_EXCLUDED_VIEWS, compare=False, repr=False)
    """EXCLUDED_VIEW (n,): with which it begins."""

    @property
    def start(self) -> SegmentStart:
        """Where it continues the one before."""
        return SegmentStart(self.first, self.excluded)


def segments(
    frame_rate: float, config: Config, first: int, stop: int, gaps: Sequence[tuple[int, int]] = ()
) -> list[Segment]:
    """Segments that cover frames first .. stop - 1 except for gaps, aligned to the commit ranges of windows.

    A remainder at the end, or before a gap, of at most a window is added to the last segment. A range shorter than two
    segments is divided in two if a half has at least a third of a segment. Each gap is a new beginning, as that of a
    run: neither a segment nor its warm-up extends across a gap.

    Parameters
    ----------
    frame_rate
        Frames per second.
    config
        Lengths of segments and windows.
    first, stop
        The frames of the run, half open.
    gaps
        Ranges without any image, half open, in ascending order, within the run (`find_gaps`).
    """
    begins, ends = [first, *(end for _, end in gaps)], [*(begin for begin, _ in gaps), stop]
    parts = [part for begin, end in zip(begins, ends, strict=True) for part in _parts(frame_rate, config, begin, end)]
    return [replace(part, index=k) for k, part in enumerate(parts)]


def longest_absence(config: TrackingConfig) -> float:
    """Longest time without detections over which a track is continued, linked or interpolated, seconds."""
    return max(config.patience, config.maximum_gap, config.interpolation_gap)


def find_gaps(ranges: Sequence[Ints], first: int, stop: int, longest: float) -> list[tuple[int, int]]:
    """Gaps of a recording: half-open ranges of frames in which all cameras are blind.

    Parameters
    ----------
    ranges : int64 (range, 2) each
        Frames in which each camera has an image, half-open ranges.
    first, stop
        The frames of the run, half open.
    longest
        Greatest length of an interruption that is not a gap, frames.
    """
    within = np.clip(np.concatenate([[[first, first]], *ranges, [[stop, stop]]]), first, stop)
    begins, ends = within[within[:, 0].argsort(kind="stable")].T
    reached = np.maximum.accumulate(ends)[:-1].tolist()
    return [(begin, end) for begin, end in zip(reached, begins[1:].tolist(), strict=True) if end - begin > longest]


def _parts(frame_rate: float, config: Config, first: int, stop: int) -> list[Segment]:
    """The segments of a range of frames without gaps; empty for an empty range."""
    if first == stop:
        return []
    if (middle := _middle(frame_rate, config, first, stop)) is not None:
        lead = max(first, middle - _lengths(frame_rate, config).warm_up)
        return [Segment(0, first, first, middle), Segment(1, lead, middle, stop)]
    parts: list[Segment] = []
    for segment in endless_segments(frame_rate, config, first):
        if segment.stop >= stop - window_length(frame_rate, config.tracking)[0]:
            return [*parts, replace(segment, stop=stop)]
        parts.append(segment)
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
    """Division of a range shorter than two segments; None where the halves would be too short.

    With its warm-up the second has as many frames as the first: two processes end together, at the same cost as by any
    other division.
    """
    lengths, half = _lengths(frame_rate, config), (stop - first) // 2
    least = max(lengths.segment // _SHORTEST, 2 * window_length(frame_rate, config.tracking)[0])
    if half < least or half >= lengths.segment:
        return None
    even = first + half + min(lengths.warm_up, half) // 2
    return (even - lengths.offset) // lengths.stride * lengths.stride + lengths.offset


def endless_segments(frame_rate: float, config: Config, first: int, index: int = 0) -> Iterator[Segment]:
    """Segments of a run of unknown length from a frame on; `index` is the number of the first one.

    A segment stays open until the frames of a window have followed it. If the run ends before, it is the last segment,
    and includes the frames that have followed.
    """
    lengths = _lengths(frame_rate, config)
    begin = lead = first
    for stop in count(lengths.segment + lengths.offset, lengths.segment):
        if stop > begin:
            yield Segment(index, lead, begin, stop)
            index, begin, lead = index + 1, stop, max(first, stop - lengths.warm_up)
