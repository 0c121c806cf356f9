"""One segment of a run: read, followed, written to its own file. It depends on no other segment."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from stseg.arrays import Bytes, Ints, Labels, Singles
from stseg.config import Config
from stseg.engine.backgrounds import BackgroundFrames, background_frames, make_foregrounds
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.image_shift import ImageShifts
from stseg.engine.pipeline import Pipeline
from stseg.engine.segments import Segment, find_gaps, longest_absence, segments
from stseg.engine.session import run_session
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry.nearest_person import nearest_person
from stseg.io.config_file import format_config
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.recording.stream_index import StreamIndex
from stseg.io.runfile.layout import ghost_type
from stseg.io.runfile.runs import RunWriter
from stseg.io.runfile.work_folder import keep_segment
from stseg.model.tables import TRACK

VolumeKind = Literal["none", "tracks", "all"]
_AROUND = 1.0
"""How far from a track the volume is kept where it is kept around tracks, metres."""


@dataclass(frozen=True)
class Job:
    """What all segments of a run have in common.

    Attributes
    ----------
    recording, config, tracker
        What is run, and how.
    volume
        What is kept of the volume: all of it, what is near tracks, or nothing.
    first, stop
        The frames of the run, half open.
    streams
        What counting the recording told.
    """

    recording: Recording
    config: Config
    tracker: str
    volume: VolumeKind
    first: int
    stop: int
    streams: StreamIndex

    @cached_property
    def read(self) -> Recording:
        """The recording as it is read: with images no larger than the foreground needs."""
        return self.recording.reduced(self.config.foreground.body_rows)

    def gaps(self) -> list[tuple[int, int]]:
        """Frames of the run that no camera shows, for longer than anybody is waited for: half-open ranges."""
        longest = longest_absence(self.config.tracking) * self.recording.rig.frame_rate
        return find_gaps(self.streams.coverage(self.recording), self.first, self.stop, longest)

    def segments(self) -> list[Segment]:
        """What the run is divided into, in the order of time."""
        return segments(self.recording.rig.frame_rate, self.config, self.first, self.stop, self.gaps())

    def pipeline(self) -> Pipeline:
        """The stages, which see nothing yet."""
        sources = [source.source.kind for source in self.recording.sources]
        kinds = ["boxes" if kind in ("boxes", "instances") else "pixels" for kind in sources]
        return Pipeline(self.read.read_rig, kinds, self.config, self.tracker)


class SegmentWorker:
    """Makes segments of one job, any of them in any order."""

    def __init__(self, job: Job) -> None:
        self.job, self.pipeline = job, job.pipeline()
        self._ends = [*(begin for begin, _ in job.gaps()), job.stop]
        self._learned = list[ViewForeground]()
        self._looks: BackgroundFrames | None = None

    def make(self, segment: Segment, draft: Path, advance: Callable[[int], None]) -> Path:
        """Write a segment's file; its name at the end. `advance` is told how many more of its frames were fused."""
        job = self.job

        def fused(frame: int) -> None:
            advance(int(segment.first <= frame < segment.stop))

        views: Bytes = self.pipeline.occupancy.views
        foregrounds = self.sights(segment)
        shifts = ImageShifts(foregrounds, job.read.factors, job.recording.rig.frame_rate)
        end = min(end for end in self._ends if end >= segment.stop)
        with (
            open_frames(job.read, segment.lead, end, job.streams) as moments,
            RunWriter(
                draft, job.recording, views, format_config(job.config), overwrite=True, kept=job.volume
            ) as writer,
        ):
            for step in run_session(self.pipeline, foregrounds, shifts.seen(moments), segment.lead, fused):
                write_step(job, step, segment, writer)
                if step.commit.scenes[-1].frame >= segment.stop - 1:
                    break
            writer.append("shifts", shifts.rows(segment.first, segment.stop))
            writer.finish(np.zeros(0, TRACK))
        return keep_segment(draft)

    def sights(self, segment: Segment) -> list[ViewForeground]:
        """What a segment sees by: with the backgrounds that were learned last, if they are this segment's too."""
        job = self.job
        looks = background_frames(segment, job.config.segments, job.recording.rig.frame_rate, job.first, job.stop)
        if looks != self._looks:
            self._learned = make_foregrounds(job.read, job.config, job.first, job.stop, segment, job.streams)
            self._looks = looks
        return deepcopy(self._learned)


def write_step(job: Job, step: CommittedFrames, segment: Segment, writer: RunWriter) -> None:
    """The segment's frames of a step; of the warm-up the trajectory alone, by which segments are joined."""
    own = step.within(segment.first, segment.stop)
    writer.append("trajectory", step.within(segment.lead, segment.stop).commit.trajectory)
    writer.append("timings", own.timings)
    if not own.commit.scenes:
        return
    frames = np.array([scene.frame for scene in own.commit.scenes])
    log_odds = np.stack([scene.log_odds for scene in own.commit.scenes])
    writer.append_frames(frames, *_kept(job, own, frames, log_odds))
    ghosts = np.zeros(len(own.candidates), ghost_type(len(job.recording.sources)))
    for name in own.candidates.dtype.names or ():
        ghosts[name] = own.candidates[name]
    ghosts["parts"] = own.parts
    writer.append("ghosts", ghosts)
    writer.append("events", own.commit.events)
    writer.append("windows", own.commit.windows)
    writer.append("rates", own.rates)


def _kept(job: Job, step: CommittedFrames, frames: Ints, log_odds: Singles) -> tuple[Singles, Labels]:
    """What is kept of the volume of a step."""
    label, rows = step.commit.label, step.commit.trajectory
    if job.volume == "none":
        return np.full_like(log_odds, np.nan), np.zeros_like(label)
    if job.volume == "tracks":
        ground = job.recording.rig.grid.ground
        for frame, volume in zip(frames, log_odds, strict=True):
            here = rows[rows["frame"] == frame]
            volume[:, nearest_person(ground, np.column_stack([here["x"], here["y"]]), _AROUND) < 0] = np.nan
    return log_odds, label
