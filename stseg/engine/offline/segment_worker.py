"""Tracking of one segment: frames in, a segment file out. Of other segments it knows the views excluded before it."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from copy import deepcopy
from pathlib import Path

from stseg.engine.offline.backgrounds import BackgroundFrames, background_frames, learn_foregrounds, take_first_light
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_writer import SegmentWriter
from stseg.engine.offline.segments import Segment
from stseg.engine.reporter import Advance
from stseg.engine.session import run_session, two_cores
from stseg.foreground.view_foreground import ViewForeground
from stseg.io.machine import return_freed_memory
from stseg.io.recording.frames import open_frames


class SegmentWorker:
    """Makes segments of one job, any of them in any order; `cores` is asked at each frame, see `run_session`."""

    def __init__(self, job: Job, cores: Callable[[], int] = two_cores) -> None:
        self.job, self.pipeline, self.cores = job, job.pipeline(), cores
        self.ends = [*(begin for begin, _ in job.gaps()), job.stop]
        """Frames beyond which no segment before them is read, rising."""
        self._learned = list[ViewForeground]()
        self._learned_from: BackgroundFrames | None = None

    def make(self, segment: Segment, draft: Path, advance: Advance) -> Path:
        """Track a segment, write its file as a draft, and return the finished file, whose name has its checksum.

        `advance` is called with the number of further frames of the segment that were fused.
        """
        job = self.job
        return_freed_memory()  # of the segment before

        def fused(frame: int) -> None:
            advance(int(segment.first <= frame < segment.stop))

        foregrounds = self.foregrounds(segment)
        end = min(end for end in self.ends if end >= segment.stop)
        with (
            open_frames(job.read, segment.lead, end, job.streams) as frame_sets,
            SegmentWriter(job, segment, self.pipeline.occupancy.views, draft) as writer,
            ExitStack() as threads,
        ):
            packing: Executor | None = None
            factors, start = job.read.factors, segment.start
            for step in run_session(
                self.pipeline, foregrounds, frame_sets, segment.lead, fused, self.cores, factors, start
            ):
                if packing is None and self.cores() > 1:
                    packing = threads.enter_context(ThreadPoolExecutor(1, "packing"))
                writer.write(step, executor=packing)
                if step.commit.frames[-1].frame >= segment.stop - 1:
                    break
            return writer.keep()

    def foregrounds(self, segment: Segment) -> list[ViewForeground]:
        """Foreground models at a segment's first frame; the last learned backgrounds are reused where they hold."""
        job = self.job
        frames = background_frames(segment, job.config.segments, job.recording.rig.frame_rate, job.first, job.stop)
        if frames != self._learned_from:
            self._learned = learn_foregrounds(job.read, job.config, frames, job.streams)
            self._learned_from = frames
        foregrounds = deepcopy(self._learned)
        take_first_light(foregrounds, job.read, job.config, segment, job.streams)
        return foregrounds
