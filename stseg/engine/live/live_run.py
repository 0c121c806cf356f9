"""Online processing of a recording in progress: frame sets in, finished segments and rows of the live table out.

Every frame set goes to the open segment, and near the end of that segment also to the next one, as its warm-up. Thus
each frame is read once, and no frame is stored.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Self

import numpy as np

from stseg.arrays import Rows
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.live.live_foreground import LiveForegrounds
from stseg.engine.offline.assembly import FinishedSegment
from stseg.engine.offline.due_segments import excluded_at_borders
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_writer import SegmentWriter
from stseg.engine.offline.segments import Segment
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import Session
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.live.live_stream import now
from stseg.io.live.live_tables import CorrectionTable, LiveTable
from stseg.io.live.publishing import Publisher
from stseg.io.recording.frames import FrameSet
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.records.border import Border
from stseg.records.tables import TRAJECTORY
from stseg.trackers import find_tracker
from stseg.tracking.windows.windows import window_length
from stseg.trajectories.live_ids import LiveCorrections, LiveIds, Names, renamed
from stseg.view_health.blind_views import BlindViews


class LiveRun:
    """Online run: distributes frame sets to the open segments and publishes their tracks.

    A context manager: after an error the open segments are discarded.

    Parameters
    ----------
    job, folder
        The job, and the folder of its segments.
    table, corrections
        The live table, to which committed track rows are appended, and that of its corrected ids.
    publisher
        Sends them on, too; None for nowhere.
    foregrounds
        Foreground models of the cameras.
    finished
        Finished segments of an interrupted run; those of this run are appended.
    """

    def __init__(
        self,
        job: Job,
        folder: WorkFolder,
        table: LiveTable,
        corrections: CorrectionTable,
        publisher: Publisher | None,
        foregrounds: LiveForegrounds,
        finished: list[FinishedSegment],
    ) -> None:
        self.foregrounds, self.finished = foregrounds, finished
        self._job, self._folder, self._table, self._publisher = job, folder, table, publisher
        self._corrections = corrections
        frame_rate = job.recording.rig.frame_rate
        self._window = window_length(frame_rate, job.config.tracking)[0]
        warm_up = round(job.config.segments.warm_up * frame_rate)
        self._names = LiveIds(table.rows, corrections.rows, warm_up + 2 * self._window)
        self._decided_again = LiveCorrections(frame_rate, Border.of(job.read.reduced_rig), job.config)
        self._blind_views = BlindViews([camera.name for camera in job.recording.rig.cameras])
        self.pipeline = job.pipeline()
        """The stages, shared by all segments."""
        self._opened: list[OpenSegment] = []
        self._plan: Iterator[Segment] = iter(())
        self._coming: Segment | None = None
        self._since, self._stop, self._published = 0, 0, 0
        self._arrived: dict[int, float] = {}
        self._delays: list[float] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        if any(reason):
            self._discard()

    @property
    def delay(self) -> str:
        """Latency from the arrival of frames to their tracks in the live table, in words; empty without any tracks."""
        if not self._delays:
            return ""
        return f", published {median(self._delays):.1f} s after arrival (median; at most {max(self._delays):.1f} s)"

    def begin(self, plan: Iterator[Segment], since: int) -> None:
        """Set the plan of segments in their order; the first begins with the first frame set.

        `since` is the first frame of the first background period.
        """
        self._plan, self._coming, self._since = plan, next(plan), since
        self._published = self._coming.first

    def add(self, frame_set: FrameSet) -> None:
        """Process the next frame set."""
        self.foregrounds.update(frame_set, self._since)
        self._blind_views.note(frame_set.frame, frame_set.views, frame_set.dropped)
        self._arrived[frame_set.frame] = frame_set.arrived
        self._stop = frame_set.frame + 1
        while self._coming is not None and frame_set.frame >= self._coming.lead:
            self._open(self._coming)
            self._coming = next(self._plan, None)
        for opened, later in pairwise(self._opened):
            if frame_set.frame == later.segment.first:
                later.session.follow(opened.session)
        for opened in self._opened:
            self._take(opened, opened.session.add(frame_set), opened.segment.stop)
        if self._opened:
            oldest = self._opened[0]
            if oldest.complete and frame_set.frame >= oldest.segment.stop + self._window:
                self._keep(oldest.segment.stop)

    def finish(self) -> list[FinishedSegment]:
        """Close the run after its last frame set; all finished segments."""
        if self._opened and self._opened[0].segment.first < self._stop:
            self._take(self._opened[0], self._opened[0].session.finish(), self._stop)
            self._keep(self._stop)
        self._discard()
        return self.finished

    def _open(self, segment: Segment) -> None:
        draft = self._folder.draft(segment.index)
        if self._opened:
            segment = replace(segment, excluded=self._opened[-1].session.excluded)
        elif self.finished:
            segment = replace(segment, excluded=excluded_at_borders(*self.finished[-1])[1])
        self._opened.append(OpenSegment(self._job, segment, self.pipeline, self.foregrounds.snapshot(), draft))

    def _take(self, opened: OpenSegment, steps: list[CommittedFrames], stop: int) -> None:
        for step in steps:
            frames = [fused.frame for fused in step.commit.frames]
            opened.write(step, self._blind_views.events(frames))
            self._publish(opened, step, stop)

    def _publish(self, opened: OpenSegment, step: CommittedFrames, stop: int) -> None:
        """Append newly committed track rows to the live table; the warm-up belongs to the segment before."""
        segment, rows = opened.segment, step.commit.trajectory
        last = step.commit.frames[-1].frame
        opened.warm_up.append(rows[rows["frame"] < segment.first])
        if last < segment.first:
            return
        if opened.names is None:
            opened.names = self._names.begin(np.concatenate([*opened.warm_up, np.zeros(0, TRAJECTORY)]))
        new = step.within(max(segment.first, self._published), stop)
        if not new.commit.frames:
            return
        rows = self._names.named(new.commit.trajectory, opened.names)
        self._table.append(rows)
        if self._publisher is not None:
            self._publisher.append(rows)
        self._correct(opened, rows, new)
        self._published = new.commit.frames[-1].frame + 1
        self._delays += [now() - self._arrived.pop(fused.frame) for fused in new.commit.frames]

    def _correct(self, opened: OpenSegment, rows: Rows, new: CommittedFrames) -> None:
        """Decide live ids again with newly published rows, and append what is corrected; some trackers' are final."""
        if find_tracker(self._job.tracker).final:
            return
        found = self._decided_again.decide(rows, new.appearance, self._names.new_id)
        if not len(found):
            return
        self._corrections.append(found)
        if self._publisher is not None:
            self._publisher.correct(found)
        self._names.correct(found)
        present = set(new.commit.trajectory["id"].tolist())
        for other in self._opened:
            if other.names is not None:
                other.names = renamed(other.names, found, present if other is opened else ())

    def _keep(self, stop: int) -> None:
        """Finish the oldest segment before frame `stop`."""
        opened = self._opened.pop(0)
        self.finished.append(FinishedSegment(*opened.keep(stop)))
        self._blind_views.forget(min((other.segment.lead for other in self._opened), default=stop))

    def _discard(self) -> None:
        for opened in self._opened:
            opened.close()
        self._opened = []


class OpenSegment:
    """A segment in progress and its unfinished file, which `keep` completes and `close` discards.

    Parameters
    ----------
    job, segment
        The job, and the segment; the last segment of a run may end earlier or later than planned.
    pipeline
        The stages.
    foregrounds
        Foreground model of each camera, owned by this segment.
    draft
        Path of the unfinished file.
    """

    def __init__(
        self, job: Job, segment: Segment, pipeline: Pipeline, foregrounds: list[ViewForeground], draft: Path
    ) -> None:
        self.segment, self.warm_up = segment, list[Rows]()
        """The segment, and TRAJECTORY rows (n,) of its warm-up."""
        self.names: Names | None = None
        """The run's ids of the segment's tracks; None during the warm-up."""
        self.session = Session(pipeline, foregrounds, segment.lead, job.read.factors, segment.start)
        """The stages, by which its frame sets are processed."""
        self._writer = SegmentWriter(job, segment, pipeline.occupancy.views, draft)
        self._beyond: list[tuple[CommittedFrames, Rows]] = []
        """Steps beyond the planned end; part of this segment only if it is the last of the run."""
        self._committed = segment.lead

    @property
    def complete(self) -> bool:
        """Whether all frames of the segment are committed."""
        return self._committed >= self.segment.stop

    def close(self) -> None:
        """Close the writer; a file that was not kept is discarded."""
        self._writer.close()

    def write(self, step: CommittedFrames, events: Rows) -> None:
        """Append a step of the session to the file, with further EVENT rows of its frames."""
        self._committed = step.commit.frames[-1].frame + 1
        if self._committed > self.segment.stop:
            self._beyond.append((step, events))
        else:
            self._writer.write(step, events)

    def keep(self, stop: int) -> tuple[Segment, Path]:
        """The segment with its final end before frame `stop`, and the path of its finished file."""
        self.segment = self._writer.segment = replace(self.segment, stop=stop)
        for step, events in self._beyond:
            if step.commit.frames[0].frame < stop:
                self._writer.write(step, events)
        return self.segment, self._writer.keep()
