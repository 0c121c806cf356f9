"""The file of a segment: a run file of its frames, and of its warm-up the trajectory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stseg.arrays import Bytes, Labels, Singles
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.job import Job
from stseg.engine.segments import Segment
from stseg.geometry.nearest_person import nearest_person
from stseg.io.config_file import format_config
from stseg.io.runfile.layout import ghost_type
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


def write_step(job: Job, step: CommittedFrames, segment: Segment, writer: RunWriter) -> None:
    """Append committed frames to a segment's file.

    Of the warm-up only the trajectory is written: by it the segment's tracks are associated with those of the segment
    before (`stseg.tracking.stitching`).
    """
    own = step.within(segment.first, segment.stop)
    writer.append("trajectory", step.within(segment.lead, segment.stop).commit.trajectory)
    writer.append("timings", own.timings)
    if not own.commit.frames:
        return
    frames = np.array([scene.frame for scene in own.commit.frames])
    packed = [packed_volume(*_kept(job, own, k)) for k in range(len(frames))]
    writer.append_packed_log_odds(frames, [log_odds for log_odds, _ in packed])
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
