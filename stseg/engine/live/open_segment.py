"""Online processing of one segment: frame sets in, committed results appended to the segment's file."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.image_shift import ImageShifts
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_file import open_segment_file, packed_step, write_step
from stseg.engine.offline.segments import Segment
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import Session
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.live.live_frames import LiveFrameSet
from stseg.io.runfile.unfinished.segment_files import keep_segment
from stseg.records.tables import TRACK


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
        self.segment = segment
        self._job, self._draft = job, draft
        self._session = Session(pipeline, foregrounds, segment.lead)
        self._shifts = ImageShifts(foregrounds, job.read.factors, job.recording.rig.frame_rate)
        self._beyond: list[tuple[CommittedFrames, Rows]] = []
        """Steps beyond the planned end; part of this segment only if it is the last of the run."""
        self._committed = segment.lead
        self._opened = ExitStack()
        self._writer = self._opened.enter_context(open_segment_file(job, pipeline.occupancy.views, draft))

    @property
    def complete(self) -> bool:
        """Whether all frames of the segment are committed."""
        return self._committed >= self.segment.stop

    def close(self) -> None:
        """Close the writer; a file that was not kept is discarded."""
        self._opened.close()

    def add(self, frame_set: LiveFrameSet) -> list[CommittedFrames]:
        """Process the next frame set; the frames that it commits."""
        self._shifts.measure(frame_set)
        return self._session.add(frame_set)

    def finish(self) -> list[CommittedFrames]:
        """Commit the frames that are still open, after the last frame set."""
        return self._session.finish()

    def write(self, step: CommittedFrames, events: Rows) -> None:
        """Append a step from `add` or `finish` to the file, with further EVENT rows of its frames."""
        self._committed = step.commit.frames[-1].frame + 1
        if self._committed > self.segment.stop:
            self._beyond.append((step, events))
        else:
            self._write(step, events)

    def keep(self, stop: int) -> tuple[Segment, Path]:
        """Finish the segment's file.

        Parameters
        ----------
        stop
            The frame after the last of the segment.

        Returns
        -------
        tuple of Segment and Path
            The segment with its final end, and the path of its file.
        """
        self.segment = replace(self.segment, stop=stop)
        for step, events in self._beyond:
            if step.commit.frames[0].frame < stop:
                self._write(step, events)
        self._writer.append("shifts", self._shifts.rows(self.segment.first, self.segment.stop))
        self._writer.finish(np.zeros(0, TRACK))
        self._opened.close()
        return self.segment, keep_segment(self._draft)

    def _write(self, step: CommittedFrames, events: Rows) -> None:
        write_step(self._job, packed_step(self._job, step, self.segment, None), self._writer)
        own = (self.segment.first <= events["frame"]) & (events["frame"] < self.segment.stop)
        self._writer.append("events", events[own])
