"""`stseg.plan`: duration and size of a run, from short parts of its recording that are tracked."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time, thread_time

import numpy as np

from stseg.arrays import Floats
from stseg.config import Config
from stseg.config.keys import require_effect
from stseg.engine.memory import require_memory
from stseg.engine.offline.assembly import FinishedSegment, assemble
from stseg.engine.offline.frame_range import FrameRange, FrameSpan, resolve_frames
from stseg.engine.offline.job import Job
from stseg.engine.offline.segment_worker import SegmentWorker
from stseg.engine.offline.segments import Segment
from stseg.engine.recordings import config_of, recording_of
from stseg.engine.reporter import AnyReporter, reporter_of
from stseg.engine.rig_body import with_body_of
from stseg.engine.workers.workforce import Workforce
from stseg.io.machine import free_cores
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.recording import Recording
from stseg.io.runfile.layout import VolumeKind
from stseg.tracking.windows.windows import window_length

_PLACES = 3
"""Number of tried parts, spread over the recording: where few people are, and where many are."""
_FRAMES = 12
"""Frames of each, so that all take no longer than a second or two."""
_READY = 4
"""First frames of a part that do not count: frames without tracks cost more than others."""


@dataclass(frozen=True)
class Forecast:
    """Cost of a run.

    Attributes
    ----------
    frames, segments, workers
        Of the run, of which each segment is made by one worker.
    starting, counting, learning, tracking, joining
        Seconds of work of one worker: loading kernels, counting all streams, learning backgrounds, making all segments,
        writing the run file.
    file_bytes
        Size of the run file; the folder of segments beside it takes as much until it stands.
    """

    frames: int
    segments: int
    workers: int
    starting: float
    counting: float
    learning: float
    tracking: float
    joining: float
    file_bytes: int

    @property
    def seconds(self) -> float:
        """From the beginning to the end, by workers that do not slow each other down."""
        rounds = -(-self.segments // min(self.workers, self.segments))
        shared = (self.learning + self.tracking) * rounds / self.segments
        return self.starting + self.counting + shared + self.joining


def plan(
    rig: Path | str | Recording,
    *,
    frames: FrameSpan = None,
    config: Config | Path | str | None = None,
    tracker: str = "cut",
    volume: VolumeKind = "all",
    workers: int | None = None,
    progress: AnyReporter = None,
) -> Forecast:
    """Forecast the time of a run and the size of its file, as `stseg plan` does.

    The recording is counted, and a few frames of it are tracked.

    Parameters
    ----------
    rig, frames, config, tracker, volume, progress
        As of `stseg.track`.
    workers
        Processes that will share the work, and the cores of this machine, of which each has one at least; None for one
        per core as far as memory allows.

    Raises
    ------
    InputError
        As `stseg.track`.
    """
    workforce, chosen = Workforce(workers), FrameRange.of(frames)
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

    Processor time is measured: a worker with several cores needs a share of that of all threads, but no less than that
    of the thread which takes one frame after the other.
    """
    cuts, parts = job.segments(), list(_parts(job))
    cores = -(-free_cores() // min(workers, len(cuts)))  # a run of one segment has one worker
    work = SegmentWorker(job, lambda: cores)
    work.ends = sorted({min(parts[0].first + 1, job.stop), *(part.stop for part in parts)})
    tracking, learning, made = list[float](), list[float](), list[FinishedSegment]()
    with TemporaryDirectory() as name:
        folder = Path(name)
        ready, begin = replace(parts[0], stop=work.ends[0]), perf_counter()  # loads kernels, before others count
        path = work.make(ready, folder / "ready.h5", lambda _: None)
        assemble(job, [FinishedSegment(ready, path)], folder / "run.h5")
        starting = perf_counter() - begin
        for part in parts:
            begin = process_time()
            work.foregrounds(part)
            learning.append(process_time() - begin)
            clock = [(process_time(), thread_time())]
            path = work.make(part, folder / f"{part.index}.h5", partial(_note_time, clock))
            made.append(FinishedSegment(part, path))
            clock.append((process_time(), thread_time()))
            tracking.append(_time_of_frame(np.array(clock), cores))
        joining = [_time_to_join(job, made[:number], folder / "run.h5") for number in (1, len(made))]
        size = (folder / "run.h5").stat().st_size
    rate, tried = job.recording.rig.frame_rate, sum(part.stop - part.first for part in parts)
    frames = sum(segment.stop - segment.first for segment in cuts)
    excess = window_length(rate, job.config.tracking)[0]  # a segment is processed until its last window is solved
    processed = sum(segment.stop - segment.lead + excess for segment in cuts)
    learned = -(-frames // round(job.config.segments.background_period * rate))
    return Forecast(
        frames,
        len(cuts),
        workers,
        starting,
        counting,
        max(learning) * learned,
        sum(tracking) / len(parts) * processed,
        joining[0] + max(joining[1] - joining[0], 0.0) / tried * frames,
        round(size / tried * frames),
    )


def _time_of_frame(clock: Floats, cores: int) -> float:
    """Time of a worker with so many cores for a frame, seconds.

    `clock` float64 (frame + 2, 2) is processor time, of all threads and of the one that takes a frame after the other:
    before the frames, after each, and when all windows are cut, which belongs to all frames alike.
    """
    frames = len(clock) - 2
    skipped = min(_READY, frames - 1)
    whole, main = (clock[-2] - clock[skipped]) / (frames - skipped)
    whole += (clock[-1, 0] - clock[-2, 0]) / frames
    return float(max(whole / cores, main))


def _time_to_join(job: Job, made: Sequence[FinishedSegment], output: Path) -> float:
    begin = process_time()
    assemble(job, made, output)
    return process_time() - begin


def _note_time(clock: list[tuple[float, float]], _: int) -> None:
    """Append the processor time of all threads, and of this one, after a further frame."""
    clock.append((process_time(), thread_time()))


def _parts(job: Job) -> list[Segment]:
    """Short parts spread over the run, without a warm-up."""
    total = job.stop - job.first
    length = min(_FRAMES, max(1, total // _PLACES))
    margin = max(total // _PLACES - length, 0) // 2
    begins = [job.first + total * place // _PLACES + margin for place in range(_PLACES)]
    return [Segment(k, begin, begin, begin + length) for k, begin in enumerate(begins) if k == 0 or total > _PLACES]
