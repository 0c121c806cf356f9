"""Overlapping windows of frames: solved together, and committed in part."""

from collections.abc import Iterator
from dataclasses import dataclass

from stseg.config import TrackingConfig

SHORTEST, LONGEST = 8, 30
ENDLESS = 1 << 62
"""Stop frame of a run without a known end."""


@dataclass(frozen=True)
class Window:
    """Half-open ranges of frames."""

    index: int
    """Counted from frame 0 of the recording, whatever part is run."""
    solve_first: int
    """First frame of one cut."""
    solve_stop: int
    """End of the frames of one cut."""
    commit_first: int
    """First frame that the window commits; the committed ranges partition the run."""
    commit_stop: int
    """End of the frames that the window commits."""


def window_length(frame_rate: float, config: TrackingConfig) -> tuple[int, int]:
    """Number of frames of a window, and of its overlap with the next."""
    length = min(max(round(config.window * frame_rate), SHORTEST), LONGEST)
    return length, max(2, length // 4)


def windows(frame_rate: float, config: TrackingConfig, first: int, stop: int) -> Iterator[Window]:
    """The windows that cover frames first .. stop - 1.

    Each of two overlapping windows commits half of their overlap, so every committed frame was solved with context on
    both sides, except at the ends of the run.
    """
    length, shared = window_length(frame_rate, config)
    stride = length - shared
    index = max(0, (first - shared // 2) // stride)
    while index * stride + shared // 2 < stop or index * stride <= first:
        start, end = index * stride, index * stride + length
        commit_first = first if index == 0 else max(first, start + shared // 2)
        commit_stop = min(end - shared + shared // 2, stop)
        if end >= stop:
            commit_stop = stop
        if commit_first < commit_stop:
            yield Window(index, max(start, first), min(end, stop), commit_first, commit_stop)
        if commit_stop >= stop:
            return
        index += 1
