"""Assembly of the run file from the segment files: stitched tracks of the whole run, and the volume with their ids."""

import os
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints
from stseg.engine.offline.calls import Caller, called_here
from stseg.engine.offline.job import Job
from stseg.engine.offline.segments import Segment
from stseg.engine.pipeline import finished_tracks
from stseg.io.config_file import format_config
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.runfile import layout
from stseg.io.runfile.packed_frames import PackedFrame, packed_frame, unpacked_label
from stseg.io.runfile.runs import Run, RunWriter, read_run
from stseg.records.tables import APPEARANCE, Tracks
from stseg.trackers import find_tracker
from stseg.tracking.segment_stitching import SegmentTracks, StitchedTracks, Stitcher, renamed_labels
from stseg.trajectories.final_tracks import CommittedRows

_BLOCK = 64
"""Frames of the volume read at a time."""
_COPIED = ("ghosts", "windows", "rates", "shifts", "timings", "appearance")
"""Tables of the segments that the run file takes unchanged."""


class FinishedSegment(NamedTuple):
    """A segment and its file."""

    segment: Segment
    path: Path


def assemble(job: Job, finished: Sequence[FinishedSegment], output: Path, call: Caller = called_here) -> Tracks:
    """Write the run file of a job from its finished segments.

    What takes no track ids is copied while the tracks are associated.

    Parameters
    ----------
    job
        The run.
    finished
        All segments of the run, in their order.
    output
        Path of the run file; an existing file is replaced.
    call
        How the tracks are associated, see `stseg.engine.offline.calls`.

    Returns
    -------
    Tracks
        The tracks of the whole run.
    """
    views = read_run(finished[0].path).views
    config, recording = format_config(job.config), with_alignment(job.recording, job.streams.frame_at_tick)
    with (
        call(_associated, job, finished) as association,
        RunWriter(output, recording, views, config, overwrite=True, kept=job.volume) as writer,
    ):
        for _, path in finished:
            _copy(read_run(path), writer)
        joined, tracks, identity = association()
        order = np.argsort(joined.committed["frame"], kind="stable")
        frame, names, ids = joined.committed["frame"][order], joined.local[order], identity[order]
        with ThreadPoolExecutor(os.cpu_count()) as packers:
            for segment, path in finished:
                here = slice(*frame.searchsorted([segment.first, segment.stop]))
                _append_labels(read_run(path), frame[here], names[here], ids[here], writer, packers)
        writer.append("trajectory", tracks.trajectory)
        if not find_tracker(job.tracker).final:
            writer.append("committed", joined.committed)
            writer.append("committed_events", joined.events)
            writer.append("known_people", job.known)
        writer.append("boxes", tracks.boxes)
        writer.append("events", tracks.events)
        writer.finish(tracks.summary())
    return tracks


def _associated(job: Job, finished: Sequence[FinishedSegment]) -> tuple[StitchedTracks, Tracks, Ints]:
    """Tracks of all segments under names of the run, tracks of the run, and the id of each joined row, 0 for none."""
    stitcher = Stitcher(round(job.config.tracking.patience * job.recording.rig.frame_rate))
    before = finished[0].segment.first if finished else 0
    appearance = [np.zeros(0, APPEARANCE)]
    for segment, path in finished:
        run = read_run(path)
        stitcher.add(SegmentTracks(segment.first, run.trajectory, run.events, segment.first - before))
        before = segment.stop
        appearance.append(run.appearance)
    joined = stitcher.joined()
    rows = CommittedRows(joined.committed, joined.events, np.concatenate(appearance), job.known)
    tracker = find_tracker(job.tracker)
    tracks, identity = finished_tracks(job.read.reduced_rig, job.config, tracker, rows, job.recording.rig)
    return joined, tracks, identity


def _copy(run: Run, writer: RunWriter) -> None:
    """Append what the run file takes unchanged of a segment."""
    for frames, log_odds in run.read_packed_frames(layout.LOG_ODDS, _BLOCK):
        writer.append_packed_log_odds(frames, log_odds)
    for table in _COPIED:
        writer.append(table, np.asarray(getattr(run, table)))


def _append_labels(run: Run, frame: Ints, names: Ints, identity: Ints, writer: RunWriter, packers: Executor) -> None:
    """Append a segment's labels, with the run's track ids, to the run file.

    Of each row of the segment are `frame` int64 (n,), rising, the track's name in the segment, and its id in the run,
    0 for none. Frames whose tracks keep their ids are copied as they are packed; the others are renamed side by side.
    """

    def renamed(number: int, label: PackedFrame) -> PackedFrame:
        here = slice(*frame.searchsorted([number, number + 1]))
        if (names[here] == identity[here]).all():
            return label
        return packed_frame(renamed_labels(unpacked_label(label, run.views.shape), names[here], identity[here]))

    for frames, label in run.read_packed_frames(layout.LABEL, _BLOCK):
        writer.append_packed_labels(list(packers.map(renamed, frames.tolist(), label)))
