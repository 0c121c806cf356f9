"""Online processing of one segment: frame sets in, committed results appended to the segment's file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from stseg.arrays import Rows
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_writer import SegmentWriter
from stseg.engine.offline.segments import Segment
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import Session
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.recording.frames import FrameSet
from stseg.trajectories.live_ids import Names


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

    Attributes
    ----------
    warm_up : list of TRAJECTORY (n,)
        Rows of the warm-up.
    names
        The run's ids of the segment's tracks; None during the warm-up.
    """

    def __init__(
        self, job: Job, segment: Segment, pipeline: Pipeline, foregrounds: list[ViewForeground], draft: Path
    ) -> None:
        self.segment, self.warm_up = segment, list[Rows]()
        self.names: Names | None = None
        self._session = Session(pipeline, foregrounds, segment.lead, job.read.factors)
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
        self._writer.__exit__(None, None, None)

    def add(self, frame_set: FrameSet) -> list[CommittedFrames]:
        """Process the next frame set; the frames that it commits."""
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
            self._writer.write(step, events)

    def keep(self, stop: int) -> tuple[Segment, Path]:
        """The segment with its final end before frame `stop`, and the path of its finished file."""
        self.segment = self._writer.segment = replace(self.segment, stop=stop)
        for step, events in self._beyond:
            if step.commit.frames[0].frame < stop:
                self._writer.write(step, events)
        return self.segment, self._writer.keep()
