"""Assembly of the run file from the segment files: stitched tracks of the whole run, and the volume with their ids."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.engine.job import Job
from stseg.engine.pipeline import finished_tracks
from stseg.engine.segments import Segment
from stseg.io.config_file import format_config
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.runfile.packed_frames import PackedFrame, packed_frame, unpacked_label
from stseg.io.runfile.runs import Run, RunWriter, read_run
from stseg.model.tables import APPEARANCE, Tracks
from stseg.trackers import find_tracker
from stseg.tracking.stitching import SegmentTracks, StitchedTracks, Stitcher, rename_labels

_BLOCK = 64
"""Frames of the volume read at a time."""
_COPIED = ("ghosts", "windows", "rates", "shifts", "timings", "appearance")
"""Tables of the segments that the run file takes unchanged."""


class FinishedSegment(NamedTuple):
    """A segment and its file."""

    segment: Segment
    path: Path


class _SegmentRows(NamedTuple):
    """A segment's file, its committed rows, and the run's track id of each row, 0 for none."""

    run: Run
    rows: Rows
    identity: Ints


def assemble(job: Job, finished: Sequence[FinishedSegment], output: Path) -> Tracks:
    """Write the run file of a job from its finished segments.

    Parameters
    ----------
    job
        The run.
    finished
        All segments of the run, in their order.
    output
        Path of the run file; an existing file is replaced.

    Returns
    -------
    Tracks
        The tracks of the whole run.
    """
    joined, appearance = _joined(job, finished)
    shown, tracker = job.recording.rig, find_tracker(job.tracker)
    tracks, identity = finished_tracks(
        job.read.read_rig, job.config, tracker, joined.committed, joined.events, appearance, shown, job.known
    )  # fmt: skip
    views = read_run(finished[0].path).views
    config = format_config(job.config)
    recording = with_alignment(job.recording, job.streams.shown)
    with (
        RunWriter(output, recording, views, config, overwrite=True, kept=job.volume) as writer,
        ThreadPoolExecutor(os.cpu_count()) as packers,
    ):
        for part in _segment_rows(finished, joined.committed, joined.local, identity):
            _copy(part, writer, packers)
        writer.append("trajectory", tracks.trajectory)
        if not tracker.final:
            writer.append("committed", joined.committed)
            writer.append("committed_events", joined.events)
            writer.append("known", job.known)
        writer.append("boxes", tracks.boxes)
        writer.append("events", tracks.events)
        writer.finish(tracks.summary())
    return tracks


def _joined(job: Job, finished: Sequence[FinishedSegment]) -> tuple[StitchedTracks, Rows]:
    """The tracks of all segments under names of the run, and their APPEARANCE rows."""
    stitcher = Stitcher(round(job.config.tracking.patience * job.recording.rig.frame_rate))
    before = finished[0].segment.first if finished else 0
    appearance = [np.zeros(0, APPEARANCE)]
    for segment, path in finished:
        run = read_run(path)
        stitcher.add(SegmentTracks(segment.first, run.trajectory, run.events, segment.first - before))
        before = segment.stop
        appearance.append(run.appearance)
    return stitcher.joined(), np.concatenate(appearance)


def _segment_rows(
    finished: Sequence[FinishedSegment], committed: Rows, local: Ints, identity: Ints
) -> Iterator[_SegmentRows]:
    """Divide the committed rows and their ids, which are in the order of the segments, among the segments."""
    first = 0
    for segment, path in finished:
        run = read_run(path)
        stop = first + int((run.trajectory["frame"] >= segment.first).sum())
        rows = committed[first:stop].copy()
        rows["id"] = local[first:stop]
        yield _SegmentRows(run, rows, identity[first:stop])
        first = stop


def _copy(part: _SegmentRows, writer: RunWriter, packers: Executor) -> None:
    """Append a segment's volume, with the run's track ids, and its tables to the run file.

    Frames whose tracks keep their ids are copied as they are packed; the others are renamed side by side.
    """
    order = np.argsort(part.rows["frame"], kind="stable")
    rows, identity = part.rows[order], part.identity[order]

    def renamed(frame: int, label: PackedFrame) -> PackedFrame:
        first, stop = rows["frame"].searchsorted([frame, frame + 1])
        own, names = rows[first:stop], identity[first:stop]
        if (own["id"] == names).all():
            return label
        cells = unpacked_label(label, part.run.views.shape)
        rename_labels(cells[None], np.array([frame]), own, names)
        return packed_frame(cells)

    for volumes in part.run.read_packed_volumes(_BLOCK):
        label = list(packers.map(renamed, volumes.frames.tolist(), volumes.label))
        writer.append_packed_frames(volumes.frames, volumes.log_odds, label)
    for table in _COPIED:
        writer.append(table, np.asarray(getattr(part.run, table)))
