"""Length of a recording and time stamps of its frames, found by reading all streams to their ends."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Flags, Floats, Ints
from stseg.io.recording.aligned_stream import AlignedStream, decoder_threads, open_aligned_streams, recording_length
from stseg.io.recording.recording import Recording
from stseg.io.recording.time_alignment import align_in_time, coverage, with_alignment


@dataclass(frozen=True)
class StreamIndex:
    """Length and time stamps of a recording's streams, read to their ends.

    Attributes
    ----------
    length
        Frames of the recording.
    times : float64 (n,) each
        Time stamps of all frames of each file of each camera, milliseconds; nan where there is none.
    frame_at_tick : int64 (tick,) or None each
        `CameraSource.frame_at_tick` of each camera.
    notes
        Messages for the user, one line each.
    """

    length: int
    times: tuple[tuple[Floats, ...], ...]
    frame_at_tick: tuple[Ints | None, ...] = ()
    notes: tuple[str, ...] = ()

    def coverage(self, recording: Recording) -> Flags:
        """Which frames of the indexed recording each camera shows, bool (camera, length)."""
        counts = [sum(map(len, files)) for files in self.times]
        return coverage(with_alignment(recording, self.frame_at_tick), counts, self.length)

    def multi_view_range(self, recording: Recording) -> tuple[int, int]:
        """First and stop of the part that at least two cameras show; all of it where a camera is required throughout.

        A single view hardly locates anybody, so the beginning and end that only one camera shows are left out.
        """
        if any(source.on_missing == "error" for source in recording.sources):
            return 0, self.length
        multiple = np.flatnonzero(self.coverage(recording).sum(axis=0) >= min(2, len(recording.sources)))
        return (int(multiple[0]), int(multiple[-1]) + 1) if len(multiple) else (0, self.length)


def count_frames(recording: Recording) -> int:
    """Number of frames of a recording; raises as `index_streams` does."""
    return index_streams(recording).length


def index_streams(recording: Recording) -> StreamIndex:
    """Index a recording: its number of frames, their stamps and the alignment of its cameras, by decoding all.

    Raises
    ------
    SourceError, FormatError
        Where a source is missing, empty or not of its kind, or the streams do not end together.
    """
    with ExitStack() as opened:
        streams = open_aligned_streams(recording, opened)
        pool = opened.enter_context(ThreadPoolExecutor(decoder_threads(recording)))
        times = tuple(counted.result() for counted in [pool.submit(stream.read_times) for stream in streams])
        return index_from_times(recording, times, streams)


def index_from_times(
    recording: Recording, times: Sequence[Sequence[Floats]], streams: list[AlignedStream] | None = None
) -> StreamIndex:
    """The index of a recording whose time stamps are known, float64 (n,) each; raises as `index_streams` does."""
    alignment = align_in_time(recording, times)
    aligned = with_alignment(recording, alignment.frame_at_tick)
    with ExitStack() as opened:
        streams = streams or open_aligned_streams(recording, opened)
        for stream, source, files in zip(streams, aligned.sources, times, strict=True):
            stream.align(source, sum(map(len, files)))
        length = int(recording_length(streams))
    return StreamIndex(length, tuple(map(tuple, times)), alignment.frame_at_tick, alignment.notes)
