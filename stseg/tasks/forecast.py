"""`stseg.plan`: duration and size of a run, from short parts of its recording that are tracked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

from stseg.config import Config
from stseg.config.keys import require_effect
from stseg.engine.memory import require_memory
from stseg.engine.offline.assembly import FinishedSegment, assemble
from stseg.engine.offline.frame_range import FrameRange, resolve_frames
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_worker import SegmentWorker
from stseg.engine.offline.segments import Segment
from stseg.engine.recordings import config_of, recording_of
from stseg.engine.reporter import Progress, Reporter, reporter_of
from stseg.engine.rig_body import with_body_of
from stseg.engine.workers.workforce import Workforce
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.recording import Recording
from stseg.io.runfile.layout import VolumeKind
from stseg.tracking.windows.windows import window_length

_PLACES = 4
"""Number of tried parts, spread over the recording: where few people are, and where many are."""
_FRAMES = 12
"""Frames of each, so that all take no longer than a few seconds."""
_READY = 4
"""First frames of a part that do not count: kernels are loaded, and frames without tracks cost more than others."""


@dataclass(frozen=True)
class Forecast:
    """Cost of a run.

    Attributes
    ----------
    frames, segments, workers
        Of the run, of which each segment is made by one worker.
    counting, learning, tracking, joining
        Seconds of work of one core: counting all streams, learning backgrounds, making all segments, writing the run
        file.
    file_bytes
        Size of the run file; the folder of segments beside it takes as much until it stands.
    """

    frames: int
    segments: int
    workers: int
    counting: float
    learning: float
    tracking: float
    joining: float
    file_bytes: int

    @property
    def seconds(self) -> float:
        """From the beginning to the end, by workers that do not slow each other down."""
        rounds = -(-self.segments // min(self.workers, self.segments))
        return self.counting + (self.learning + self.tracking) * rounds / self.segments + self.joining


def plan(
    rig: Path | str | Recording,
    *,
    frames: tuple[int | None, int | None] | None = None,
    config: Config | Path | str | None = None,
    tracker: str = "cut",
    volume: VolumeKind = "all",
    workers: int | None = None,
    progress: Progress | Reporter | None = None,
) -> Forecast:
    """Forecast the time of a run and the size of its file, as `stseg plan` does.

    The recording is counted, and a few frames of it are tracked.

    Parameters
    ----------
    rig, frames, config, tracker, volume, progress
        As of `stseg.track`.
    workers
        Processes that will share the work, a core each; None for one per core as far as memory allows.

    Raises
    ------
    InputError
        As `stseg.track`.
    """
    workforce, chosen = Workforce(workers), None if frames is None else FrameRange(*frames)
    recording = recording_of(rig)
    resolved = with_body_of(recording, config_of(config))
    require_effect(resolved, tracker)
    require_memory(recording.rig, resolved, recording.path)
    begin = perf_counter()
    streams = index_streams(recording)
    counting = perf_counter() - begin
    for note in streams.notes:
        reporter_of(progress).note(note)
    first, stop = resolve_frames(chosen, streams, recording)
    job = Job(recording, resolved, tracker, volume, first, stop, streams)
    return forecast(job, counting, workforce.processes(job))


def forecast(job: Job, counting: float, workers: int) -> Forecast:
    """Forecast of a job, from parts of it that are tracked now; `counting` is in seconds.

    Processor time is measured, of all threads together: workers have a core each.
    """
    work, cuts, parts = SegmentWorker(job), job.segments(), list(_parts(job))
    work.ends = [part.stop for part in parts]
    tracking, learning, made = list[float](), list[float](), list[FinishedSegment]()
    with TemporaryDirectory() as name:
        folder = Path(name)
        ready = replace(parts[0], stop=min(parts[0].first + _READY, parts[0].stop))
        work.make(ready, folder / "ready.h5", lambda _: None)
        for part in parts:
            clock = [process_time()]
            work.foregrounds(part)
            learning.append(process_time() - clock[0])
            clock = [process_time()]
            path = work.make(part, folder / f"{part.index}.h5", partial(_note_time, clock))
            made.append(FinishedSegment(part, path))
            skipped = min(_READY, len(clock) - 2)
            tracking.append((process_time() - clock[skipped]) / (len(clock) - 1 - skipped))
        begin = process_time()
        assemble(job, made, folder / "run.h5")
        joining, size = process_time() - begin, (folder / "run.h5").stat().st_size
    rate, tried = job.recording.rig.frame_rate, sum(part.stop - part.first for part in parts)
    frames = sum(segment.stop - segment.first for segment in cuts)
    excess = window_length(rate, job.config.tracking)[0]  # a segment is processed until its last window is solved
    processed = sum(segment.stop - segment.lead + excess for segment in cuts)
    learned = -(-frames // round(job.config.segments.background_period * rate))
    return Forecast(
        frames, len(cuts), workers, counting, max(learning) * learned, sum(tracking) / len(parts) * processed,
        joining / tried * frames, round(size / tried * frames),
    )  # fmt: skip


def _note_time(clock: list[float], _: int) -> None:
    """Append the processor time after a further frame."""
    clock.append(process_time())


def _parts(job: Job) -> list[Segment]:
    """Short parts spread over the run, without a warm-up."""
    total = job.stop - job.first
    length = min(_FRAMES, max(1, total // _PLACES))
    begins = [job.first + (total - length) * place // (_PLACES - 1) for place in range(_PLACES)]
    return [Segment(k, begin, begin, begin + length) for k, begin in enumerate(begins) if k == 0 or total > _PLACES]
