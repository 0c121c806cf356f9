"""The file of a segment: a run file of its frames, and of its warm-up the trajectory."""

from collections import deque
from concurrent.futures import Executor, Future
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Labels, Rows, Singles, ground_of
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.offline.job import Job
from stseg.engine.offline.segments import Segment
from stseg.geometry.nearest_person import nearest_person
from stseg.io.config_file import as_toml
from stseg.io.runfile.layout import EXCLUDED_VIEWS, ghost_type
from stseg.io.runfile.packed_frames import PackedFrame
from stseg.io.runfile.run_writer import packed_volume
from stseg.io.runfile.runs import RunWriter
from stseg.io.runfile.unfinished.work_files import keep_segment
from stseg.records.tables import EVENT, TRACK

_VOLUME_RADIUS = 1.0
"""Radius around each track within which the volume is kept, where it is kept around tracks, metres."""

_Volumes = list[tuple[PackedFrame, PackedFrame]]


class _PendingFrames(NamedTuple):
    """Committed frames on their way to the file."""

    trajectory: Rows
    """TRAJECTORY (n,): rows of the frames of the segment and of its warm-up."""
    results: CommittedFrames
    """The results of the segment's frames."""
    volumes: Future[_Volumes]
    """Their log-odds and labels, packed."""
    events: Rows
    """EVENT (k,): further events of these frames."""


class SegmentWriter(ExitStack):
    """Writes the file of a segment; one that `keep` has not completed is discarded on exit.

    Of the warm-up the file has the trajectory alone: by it the segment's tracks are associated with those of the
    segment before (`stseg.tracking.segment_stitching`).

    Parameters
    ----------
    job, segment
        The run, and the segment; its end may be changed while it is written.
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    draft
        Path of the file until it is complete.
    """

    def __init__(self, job: Job, segment: Segment, views: Bytes, draft: Path) -> None:
        super().__init__()
        self.segment = segment
        self._job, self._draft = job, draft
        self._steps = deque[_PendingFrames]()
        self._writer = self.enter_context(
            RunWriter(draft, job.recording, views, as_toml(job.config), overwrite=True, kept=job.volume)
        )
        if len(segment.excluded):
            self._writer.append(EXCLUDED_VIEWS, segment.excluded)

    def write(self, step: CommittedFrames, events: Rows | None = None, executor: Executor | None = None) -> None:
        """Append the next committed frames, with further EVENT rows (k,) of theirs; the last may be packed later.

        One thread of the executor packs volumes; without one they are packed here.
        """
        first, stop = self.segment.first, self.segment.stop
        results, trajectory = step.within(first, stop), step.within(self.segment.lead, stop).commit.trajectory
        events = np.zeros(0, EVENT) if events is None else events
        within = events[(first <= events["frame"]) & (events["frame"] < stop)]
        if executor is None:
            volumes = Future[_Volumes]()
            volumes.set_result(_packed_volumes(self._job, results))
        else:
            volumes = executor.submit(_packed_volumes, self._job, results)
        self._steps.append(_PendingFrames(trajectory, results, volumes, within))
        if len(self._steps) > 1:
            self._append(self._steps.popleft())

    def keep(self) -> Path:
        """Complete the file; its path, whose name has the checksum."""
        while self._steps:
            self._append(self._steps.popleft())
        self._writer.finish(np.zeros(0, TRACK))
        self.close()
        return keep_segment(self._draft)

    def _append(self, step: _PendingFrames) -> None:
        results, writer = step.results, self._writer
        writer.append("trajectory", step.trajectory)
        writer.append("timings", results.timings)
        excluded = results.excluded[results.excluded["frame"] == self.segment.stop - 1]
        if len(excluded):
            writer.append(EXCLUDED_VIEWS, excluded)
        if results.commit.frames:
            volumes = step.volumes.result()
            writer.append_packed_log_odds(results.frames, [log_odds for log_odds, _ in volumes])
            writer.append_packed_labels([label for _, label in volumes])
            ghosts = np.zeros(len(results.candidates), ghost_type(len(self._job.recording.sources)))
            for name in results.candidates.dtype.names or ():
                ghosts[name] = results.candidates[name]
            ghosts["parts"] = results.parts
            writer.append("ghosts", ghosts)
            writer.append("events", results.commit.events)
            writer.append("windows", results.commit.windows)
            writer.append("rates", results.rates)
            writer.append("appearance", results.appearance)
            writer.append("shifts", results.shifts)
        writer.append("events", step.events)


def _packed_volumes(job: Job, step: CommittedFrames) -> _Volumes:
    return [packed_volume(*_volume(job, step, k)) for k in range(len(step.commit.frames))]


def _volume(job: Job, step: CommittedFrames, k: int) -> tuple[Singles, Labels]:
    """Log-odds and labels (plane, y, x) of a frame as far as the job keeps the volume; nan and 0 elsewhere."""
    label, scene = step.commit.labels[k].dense(), step.commit.frames[k]
    if job.volume == "none":
        return np.full(label.shape, np.nan, np.float32), np.zeros_like(label)
    log_odds = scene.log_odds
    if job.volume == "tracks":
        rows, ground = step.commit.trajectory, job.recording.rig.grid.ground
        here = rows[rows["frame"] == scene.frame]
        log_odds[:, nearest_person(ground, ground_of(here), _VOLUME_RADIUS) < 0] = np.nan
    return log_odds, label
