"""Assembly of the run file from the segment files: stitched tracks of the whole run, and the volume with their ids."""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.engine.offline.job import Job
from stseg.engine.offline.segments import Segment
from stseg.engine.pipeline import box_tables, finished_tracks
from stseg.io.config_file import as_toml
from stseg.io.machine import return_freed_memory
from stseg.io.recording.time_alignment import with_alignment
from stseg.io.runfile import layout
from stseg.io.runfile.packed_frames import PackedFrame, packed_frame, unpacked_label
from stseg.io.runfile.runs import Run, RunWriter, read_run
from stseg.records.tables import EVENT, TRAJECTORY, Tracks
from stseg.trackers import find_tracker
from stseg.tracking.segment_stitching import SegmentTracks, Stitcher, renamed_labels
from stseg.trajectories.final_tracks import FinalTracks, box_parts

_COPIED = ("ghosts", "windows", "rates", "shifts", "timings", "appearance")
"""Tables of the segments that the run file takes unchanged."""


class FinishedSegment(NamedTuple):
    """A segment and its file."""

    segment: Segment
    path: Path


@dataclass(frozen=True)
class _StitchedSegment:
    """A finished segment, and the names of its tracks in the run."""

    first: int
    """First frame that it commits."""
    path: Path
    names: Ints
    """int64 (track,): by the name in the segment."""
    length: int
    """Number of its rows."""

    def read(self) -> Rows:
        """TRAJECTORY (n,): the rows that it commits, under its own names."""
        rows = read_run(self.path).trajectory
        return np.asarray(rows[rows["frame"] >= self.first])

    def named(self, rows: Rows) -> Rows:
        """The same rows, under names of the run from now on."""
        rows["id"] = self.names[rows["id"]]
        return rows


@dataclass(frozen=True)
class _StitchedRun:
    """Rows of a run as its tracker committed them; the trajectory is read where it is asked for, and not kept."""

    segments: list[_StitchedSegment]
    events: Rows
    """EVENT (k,)."""
    known_people: Rows
    """KNOWN_PERSON (m,)."""

    @property
    def trajectory(self) -> Rows:
        """TRAJECTORY (n,), segment by segment."""
        rows, start = np.empty(sum(part.length for part in self.segments), TRAJECTORY), 0
        for part in self.segments:
            rows[start : start + part.length] = part.named(part.read())
            start += part.length
        return rows

    @property
    def appearance_parts(self) -> "_Appearance":
        """APPEARANCE (l,) of each segment."""
        return _Appearance(self.segments)


@dataclass(frozen=True)
class _Appearance:
    """Appearance of a run, read from its segments each time that it is gone through."""

    segments: list[_StitchedSegment]

    def __iter__(self) -> Iterator[Rows]:
        return (read_run(part.path).appearance for part in self.segments)


class _Association(NamedTuple):
    """The stitched segments, their events, and the tracks that association makes of them."""

    segments: list[_StitchedSegment]
    events: Rows
    tracks: FinalTracks


def assemble(job: Job, finished: Sequence[FinishedSegment], output: Path) -> None:
    """Write the run file of a job from its finished segments.

    Rows are read and written part by part, from all segments in their order. An existing output is replaced.
    """
    return_freed_memory()  # of tracking
    views = read_run(finished[0].path).views
    config, recording = as_toml(job.config), with_alignment(job.recording, job.streams.frame_at_tick)
    segments, events, tracks = _associated(job, finished)
    with RunWriter(output, recording, views, config, overwrite=True, kept=job.volume) as writer:
        for _, path in finished:
            _copy(read_run(path), writer)
        _append_segments(job, segments, tracks.identity, writer)
        writer.append("trajectory", tracks.trajectory)
        if not find_tracker(job.tracker).final:
            writer.append("committed_events", events)
            writer.append("known_people", job.known)
        for boxes in box_parts(box_tables(job.recording.rig, job.config.body.breadth), tracks.trajectory):
            writer.append("boxes", boxes)
        writer.append("events", tracks.events)
        writer.finish(Tracks(tracks.trajectory).summary())


def _associated(job: Job, finished: Sequence[FinishedSegment]) -> _Association:
    stitcher = Stitcher(round(job.config.tracking.patience * job.recording.rig.frame_rate))
    before = finished[0].segment.first if finished else 0
    segments, events = list[_StitchedSegment](), [np.zeros(0, EVENT)]
    for segment, path in finished:
        run = read_run(path)
        found = stitcher.add(SegmentTracks(segment.first, run.trajectory, run.events, segment.first - before))
        before = segment.stop
        segments.append(_StitchedSegment(segment.first, path, found.names, len(found.committed)))
        events.append(found.events)
    rows = _StitchedRun(segments, np.concatenate(events), job.known)
    tracks = finished_tracks(job.read.reduced_rig, job.config, find_tracker(job.tracker), rows)
    return _Association(segments, rows.events, tracks)


def _append_segments(job: Job, segments: Sequence[_StitchedSegment], identity: Ints, writer: RunWriter) -> None:
    """Append the rows and the labels of all segments; of each row is its id in the run, int64 (n,), 0 for none."""
    start, is_final = 0, find_tracker(job.tracker).final
    with ThreadPoolExecutor(os.cpu_count()) as packers:
        for part in segments:
            rows, ids = part.read(), identity[start : start + part.length]
            start += part.length
            order = np.argsort(rows["frame"], kind="stable")
            _append_labels(read_run(part.path), rows["frame"][order], rows["id"][order], ids[order], writer, packers)
            if not is_final:
                writer.append("committed", part.named(rows))


def _copy(run: Run, writer: RunWriter) -> None:
    """Append what the run file takes unchanged of a segment."""
    for frames, log_odds in run.read_packed_frames(layout.LOG_ODDS):
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

    for frames, label in run.read_packed_frames(layout.LABEL):
        writer.append_packed_labels(list(packers.map(renamed, frames.tolist(), label)))
