"""A segment of a run that still goes on: frame sets in, and a file that grows until the end is known."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.image_shift import ImageShifts
from stseg.engine.job import Job
from stseg.engine.pipeline import Pipeline
from stseg.engine.segment_file import open_segment_file, write_step
from stseg.engine.segments import Segment
from stseg.engine.session import Session
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.live.live_frames import LiveFrameSet
from stseg.io.runfile.work_folder import keep_segment
from stseg.model.tables import TRACK


class OpenSegment:
    """One segment. Use it in a `with`: unless it was kept, nothing is left of it.

    Parameters
    ----------
    job, segment
        The job, and the segment; the last of a run may end at another frame than planned.
    pipeline
        The stages.
    foregrounds
        Foreground model of each camera; the segment's own.
    draft
        Path that it is written to.
    """

    def __init__(
        self, job: Job, segment: Segment, pipeline: Pipeline, foregrounds: list[ViewForeground], draft: Path
    ) -> None:
        self.segment = segment
        self._job, self._draft = job, draft
        self._session = Session(pipeline, foregrounds, segment.lead)
        self._shifts = ImageShifts(foregrounds, job.read.factors, job.recording.rig.frame_rate)
        self._beyond: list[tuple[CommittedFrames, Rows]] = []
        """Steps that go past its end: its own only if it is the last."""
        self._committed = segment.lead
        self._opened = ExitStack()
        self._writer = self._opened.enter_context(open_segment_file(job, pipeline.occupancy.views, draft))

    @property
    def whole(self) -> bool:
        """Whether all its frames are decided."""
        return self._committed >= self.segment.stop

    def close(self) -> None:
        """Discard it unless it was kept."""
        self._opened.close()

    def add(self, moment: LiveFrameSet) -> list[CommittedFrames]:
        """The next moment; what is decided by it."""
        self._shifts.look(moment)
        return self._session.add(moment)

    def finish(self) -> list[CommittedFrames]:
        """No more moments will come; what was still open."""
        return self._session.finish()

    def write(self, step: CommittedFrames, events: Rows) -> None:
        """Write a step that `add` or `finish` gave, and EVENT rows of its frames besides."""
        self._committed = step.commit.frames[-1].frame + 1
        if self._committed > self.segment.stop:
            self._beyond.append((step, events))
        else:
            self._write(step, events)

    def keep(self, stop: int) -> tuple[Segment, Path]:
        """End it before frame `stop`, and give it its name."""
        self.segment = replace(self.segment, stop=stop)
        for step, events in self._beyond:
            if step.commit.frames[0].frame < stop:
                self._write(step, events)
        self._writer.append("shifts", self._shifts.rows(self.segment.first, self.segment.stop))
        self._writer.finish(np.zeros(0, TRACK))
        self._opened.close()
        return self.segment, keep_segment(self._draft)

    def _write(self, step: CommittedFrames, events: Rows) -> None:
        write_step(self._job, step, self.segment, self._writer)
        own = (self.segment.first <= events["frame"]) & (events["frame"] < self.segment.stop)
        self._writer.append("events", events[own])
