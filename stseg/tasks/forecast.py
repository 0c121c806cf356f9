"""`stseg.plan`: duration and size of a run, from short parts of its recording that are tracked."""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import NamedTuple

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
from stseg.io.runfile.runs import read_run
from stseg.kernels.accelerate import compilation_noted
from stseg.tracking.windows.windows import window_length

_PLACES = 3
"""Number of tracked parts, spread over the recording: where few people are, and where many are."""
_FRAMES = 12
"""Frames of each, so that all take no longer than a second or two."""
_READY = 4
"""First frames of a part that do not count: frames without tracks cost more than others."""
_LEAST_FRAMES, _SECONDS = _READY + 2, 0.5
"""Frames of each part but the first at least, and about how long it takes where it has more."""

_PROCESS = 1.0
"""Time in which a process imports what it needs, seconds; workers begin once that of the command has."""


@dataclass(frozen=True)
class Forecast:
    """Cost of a run.

    Attributes
    ----------
    frames, segments, workers
        Of the run, of which each segment is made by one worker.
    starting, counting, learning, tracking, joining
        Seconds of work of one worker: imports and loading kernels, counting all streams, learning backgrounds, making
        all segments, writing the run file.
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
    reporter, compilations = reporter_of(progress), list[str]()
    for line in streams.notes:
        reporter.note(line)
    first, stop = resolve_frames(chosen, streams, recording)
    job = Job(recording, resolved, tracker, volume, first, stop, streams)

    def note(line: str) -> None:
        compilations.append(line)
        reporter.note(line)

    with compilation_noted(note):
        found = forecast(job, counting, workforce.processes(job))
    return forecast(job, counting, workforce.processes(job)) if compilations else found  # the run compiles nothing then


class _Sample(NamedTuple):
    """A short part of the run that was tracked, with its file."""

    made: FinishedSegment
    learning: float
    frame: float
    window: float
    """Seconds of learning backgrounds, of a frame, and of a window that is cut after all frames."""

    @property
    def frames(self) -> int:
        """Number of its frames."""
        return self.made.segment.stop - self.made.segment.first


def forecast(job: Job, counting: float, workers: int) -> Forecast:
    """Forecast of a job, from parts of it that are tracked now; `counting` is in seconds."""
    cuts, rate = job.segments(), job.recording.rig.frame_rate
    cores = -(-free_cores() // min(workers, len(cuts)))  # a run of one segment has one worker
    work, parts, samples = SegmentWorker(job, lambda: cores), list(_parts(job)), list[_Sample]()
    with TemporaryDirectory() as name:
        folder, begin = Path(name), perf_counter()
        one = _sample_of(work, replace(parts[0], stop=parts[0].first + 1), folder, cores)
        _time_to_join(job, one, folder)  # this and all before it loads kernels
        starting, most = perf_counter() - begin, _FRAMES
        for part in parts:
            samples.append(_sample_of(work, replace(part, stop=min(part.stop, part.first + most)), folder, cores))
            most = max(_LEAST_FRAMES, int(_SECONDS / max(samples[-1].frame, 0.01)))
        joining = [_time_to_join(job, part, folder) for part in (one, samples[0])]
        bytes_of_one = one.made.path.stat().st_size
        size = sum(part.made.path.stat().st_size - bytes_of_one for part in samples)
    frames, more = sum(segment.stop - segment.first for segment in cuts), sum(part.frames - 1 for part in samples)
    length, shared = window_length(rate, job.config.tracking)
    processed = sum(segment.stop - segment.lead + length for segment in cuts)  # until the last window is solved
    of_frame = float(np.mean([part.frame + part.window / (length - shared) for part in samples]))
    learned = -(-frames // round(job.config.segments.background_period * rate))
    joining_more = max(joining[1] - joining[0], 0.0) / max(samples[0].frames - 1, 1)
    return Forecast(
        frames,
        len(cuts),
        workers,
        starting + _PROCESS * min(workers, len(cuts), 2),
        counting,
        max(part.learning for part in samples) * learned,
        of_frame * processed,
        joining[0] + joining_more * frames,
        bytes_of_one + round(size / max(more, 1) * frames),
    )


def _sample_of(work: SegmentWorker, part: Segment, folder: Path, cores: int) -> _Sample:
    """Track a part by a worker that has so many cores.

    With one core its processor time counts. With several the whole time does: threads wait for each other.
    """
    seconds = process_time if cores == 1 else perf_counter
    work.ends, begin = [part.stop], process_time()
    work.foregrounds(part)
    learning, clock = process_time() - begin, [seconds()]
    path = work.make(part, folder / f"{part.index}_{part.stop}.h5", lambda _: clock.append(seconds()))
    clock.append(seconds())
    of_window = (clock[-1] - clock[-2]) / max(len(read_run(path).windows), 1)
    of_frame = _time_of_frame(np.array(clock), part.first, work.pipeline.detector.key_interval)
    return _Sample(FinishedSegment(part, path), learning, of_frame, of_window)


def _time_of_frame(clock: Floats, first: int, key_interval: int) -> float:
    """Mean seconds of a frame, of which one in `key_interval` is a key frame; so are the first ones of a part.

    `clock` float64 (frame + 2,) is in seconds: before the frames, which begin with `first`, after each, and after all
    windows.
    """
    durations = np.diff(clock[:-1])
    number = np.arange(len(durations))
    is_key = (number < key_interval) | ((first + number) % key_interval == 0)
    counts = number >= min(_READY, len(durations) - 1)
    of_key, of_others = (durations[counts & chosen] for chosen in (is_key, ~is_key))
    if not len(of_key) or not len(of_others):
        return float(durations[counts].mean())
    return float(of_others.mean() + (of_key.mean() - of_others.mean()) / key_interval)


def _time_to_join(job: Job, part: _Sample, folder: Path) -> float:
    begin = process_time()
    assemble(job, [part.made], folder / "run.h5")
    return process_time() - begin


def _parts(job: Job) -> list[Segment]:
    """Short parts spread over the run, without a warm-up."""
    total = job.stop - job.first
    length = min(_FRAMES, max(1, total // _PLACES))
    margin = max(total // _PLACES - length, 0) // 2
    begins = [job.first + total * place // _PLACES + margin for place in range(_PLACES)]
    return [Segment(k, begin, begin, begin + length) for k, begin in enumerate(begins) if k == 0 or total > _PLACES]
