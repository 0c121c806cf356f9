"""How long a recording is, and when its cameras' frames were taken: told by its streams themselves, to their ends."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.io.recording.aligned_stream import decoder_threads, open_aligned_streams, recording_length
from stseg.io.recording.recording import Recording
from stseg.io.recording.time_alignment import align_in_time, coverage, with_alignment


@dataclass(frozen=True)
class StreamIndex:
    """What decoding a recording's streams to their ends tells.

    Attributes
    ----------
    length
        Frames of the recording.
    times : float64 (n,) each
        Of every frame of each file of each camera, milliseconds; nan where the source states none.
    shown : int64 (tick,) or None each
        `CameraSource.shown` of each camera.
    notes
        What a user should be told of it, one line each.
    """

    length: int
    times: tuple[tuple[Floats, ...], ...]
    shown: tuple[Ints | None, ...] = ()
    notes: tuple[str, ...] = ()

    def coverage(self, recording: Recording) -> Flags:
        """Which frames of the recording that was counted each camera shows, bool (camera, length)."""
        counts = [sum(map(len, own)) for own in self.times]
        return coverage(with_alignment(recording, self.shown), counts, self.length)

    def multi_view_range(self, recording: Recording) -> tuple[int, int]:
        """The part of it that two cameras show, where none must be there all the time; else all of it.

        Two views tell where somebody is; of what one alone shows, at the beginning and the end, little can be told.
        """
        if any(source.on_missing == "error" for source in recording.sources):
            return 0, self.length
        told = np.flatnonzero(self.coverage(recording).sum(axis=0) >= min(2, len(recording.sources)))
        return (int(told[0]), int(told[-1]) + 1) if len(told) else (0, self.length)


def count_frames(recording: Recording) -> int:
    """How many frames a recording has; raises as `index_streams` does."""
    return index_streams(recording).length


def index_streams(recording: Recording) -> StreamIndex:
    """How many frames a recording has, and which frames of the cameras show them, by decoding all to their ends.

    Raises
    ------
    SourceError, FormatError
        Where a source is missing, empty or not of its kind, or the streams do not end together.
    """
    with ExitStack() as opened:
        feeds = open_aligned_streams(recording, opened)
        pool = opened.enter_context(ThreadPoolExecutor(decoder_threads(recording)))
        times = tuple(counted.result() for counted in [pool.submit(feed.run_out) for feed in feeds])
    clock = align_in_time(recording, times)
    for feed, source, own in zip(feeds, with_alignment(recording, clock.shown).sources, times, strict=True):
        feed.place(source, sum(map(len, own)))
    return StreamIndex(int(recording_length(feeds)), times, clock.shown, clock.notes)
