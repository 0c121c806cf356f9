"""The file of a segment: a run file of its frames, and of its warm-up the trajectory."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Bytes, Labels, Rows, Singles
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.offline.job import Job
from stseg.engine.offline.segments import Segment
from stseg.geometry.nearest_person import nearest_person
from stseg.io.config_file import format_config
from stseg.io.runfile.layout import ghost_type
from stseg.io.runfile.packed_frames import PackedFrame
from stseg.io.runfile.run_writer import packed_volume
from stseg.io.runfile.runs import RunWriter

_KEPT_RADIUS = 1.0
"""Radius around each track within which the volume is kept, where it is kept around tracks, metres."""


def open_segment_file(job: Job, views: Bytes, draft: Path) -> RunWriter:
    """A writer for one segment's file.

    Parameters
    ----------
    job
        The run.
    views : uint8 (plane, y, x)
        Number of views that see each cell.
    draft
        Path of the file until the segment is finished.
    """
    return RunWriter(draft, job.recording, views, format_config(job.config), overwrite=True, kept=job.volume)


class PackedStep(NamedTuple):
    """Committed frames on their way to a segment's file: those of the segment itself, and their volumes.

    Attributes
    ----------
    trajectory : TRAJECTORY (n,)
        Of the frames of the segment and of its warm-up.
    own
        The results of the segment's frames.
    volumes
        Their log-odds and labels, packed.
    """

    trajectory: Rows
    own: CommittedFrames
    volumes: Future[list[tuple[PackedFrame, PackedFrame]]]


def packed_step(job: Job, step: CommittedFrames, segment: Segment, executor: Executor | None) -> PackedStep:
    """The part of committed frames that a segment's file keeps, packed by a thread of an executor if there is one.

    Of the warm-up it is the trajectory alone: by it the segment's tracks are associated with those of the segment
    before (`stseg.tracking.windows.stitching`).
    """
    own = step.within(segment.first, segment.stop)
    trajectory = step.within(segment.lead, segment.stop).commit.trajectory
    if executor is not None:
        return PackedStep(trajectory, own, executor.submit(_packed_volumes, job, own))
    done = Future[list[tuple[PackedFrame, PackedFrame]]]()
    done.set_result(_packed_volumes(job, own))
    return PackedStep(trajectory, own, done)


def write_step(job: Job, step: PackedStep, writer: RunWriter) -> None:
    """Append committed frames to a segment's file."""
    own = step.own
    writer.append("trajectory", step.trajectory)
    writer.append("timings", own.timings)
    if not own.commit.frames:
        return
    packed = step.volumes.result()
    writer.append_packed_log_odds(own.frames, [log_odds for log_odds, _ in packed])
    writer.append_packed_labels([label for _, label in packed])
    ghosts = np.zeros(len(own.candidates), ghost_type(len(job.recording.sources)))
    for name in own.candidates.dtype.names or ():
        ghosts[name] = own.candidates[name]
    ghosts["parts"] = own.parts
    writer.append("ghosts", ghosts)
    writer.append("events", own.commit.events)
    writer.append("windows", own.commit.windows)
    writer.append("rates", own.rates)
    writer.append("appearance", own.appearance)


def _packed_volumes(job: Job, step: CommittedFrames) -> list[tuple[PackedFrame, PackedFrame]]:
    return [packed_volume(*_kept(job, step, k)) for k in range(len(step.commit.frames))]


def _kept(job: Job, step: CommittedFrames, k: int) -> tuple[Singles, Labels]:
    """Log-odds and labels (plane, y, x) of a frame as far as the job keeps the volume; nan and 0 elsewhere."""
    label, scene = step.commit.label[k], step.commit.frames[k]
    if job.volume == "none":
        return np.full(label.shape, np.nan, np.float32), np.zeros_like(label)
    log_odds = scene.log_odds
    if job.volume == "tracks":
        rows, ground = step.commit.trajectory, job.recording.rig.grid.ground
        here = rows[rows["frame"] == scene.frame]
        log_odds[:, nearest_person(ground, np.column_stack([here["x"], here["y"]]), _KEPT_RADIUS) < 0] = np.nan
    return log_odds, label
