"""From the files of all segments to the run file: tracks of the whole run, and the volume with their ids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Ints, Rows
from stseg.engine.job import Job
from stseg.engine.pipeline import Pipeline
from stseg.engine.segments import Segment
from stseg.io.config_file import format_config
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.runfile.runs import Run, RunWriter, read_run
from stseg.model.tables import Tracks
from stseg.tracking.stitching import SegmentTracks, Stitcher, rename_labels

_FRAMES = 64
"""Frames of the volume in memory at a time."""
_COPIED = ("ghosts", "windows", "rates", "shifts", "timings")


class FinishedSegment(NamedTuple):
    """A segment and the file that holds it."""

    segment: Segment
    path: Path


class _Named(NamedTuple):
    """A segment's file, its committed rows, and the run's track id of each of them, 0 for none."""

    run: Run
    rows: Rows
    identity: Ints


def assemble(job: Job, pipeline: Pipeline, made: Sequence[FinishedSegment], output: Path) -> Tracks:
    """Write the run file of a job from its segments, in their order; the pipeline is the job's."""
    stitcher = Stitcher(round(job.config.tracking.patience * job.recording.rig.frame_rate))
    before = made[0].segment.first if made else 0
    for segment, path in made:
        run = read_run(path)
        stitcher.add(SegmentTracks(segment.first, run.trajectory, run.events, segment.first - before))
        before = segment.stop
    joined = stitcher.joined()
    tracks, identity = pipeline.finished(joined.committed, joined.events, job.recording.rig)
    views: Bytes = pipeline.occupancy.views
    config = format_config(job.config)
    recording = with_alignment(job.recording, job.streams.shown)
    with RunWriter(output, recording, views, config, overwrite=True, kept=job.volume) as writer:
        for named in _named(made, joined.committed, joined.local, identity):
            _copy(named, writer)
        writer.append("trajectory", tracks.trajectory)
        writer.append("boxes", tracks.boxes)
        writer.append("events", tracks.events)
        writer.finish(tracks.summary())
    return tracks


def _named(made: Sequence[FinishedSegment], committed: Rows, local: Ints, identity: Ints) -> Iterator[_Named]:
    """Segment by segment; rows of the run stand in their order."""
    row = 0
    for segment, path in made:
        run = read_run(path)
        stop = row + int((run.trajectory["frame"] >= segment.first).sum())
        rows = committed[row:stop].copy()
        rows["id"] = local[row:stop]
        yield _Named(run, rows, identity[row:stop])
        row = stop


def _copy(named: _Named, writer: RunWriter) -> None:
    for frames, log_odds, label in named.run.read_volumes(_FRAMES):
        rename_labels(label, frames, named.rows, named.identity)
        writer.append_frames(frames, log_odds, label)
    for table in _COPIED:
        writer.append(table, np.asarray(getattr(named.run, table)))
