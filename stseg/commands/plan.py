"""`stseg plan`: how long a run will take and how large its file will be, before it is begun."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.run import frame_range
from stseg.engine.assembly import FinishedSegment, assemble
from stseg.engine.segment import Job, SegmentWorker, VolumeKind
from stseg.engine.segments import Segment
from stseg.errors import ConfigError
from stseg.io.config_file import read_config
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig
from stseg.io.recording.stream_index import index_streams

_SECONDS = 10.0
"""How much of the recording is tried."""
_PLACES = 3
"""At how many places."""
_READY = 4
"""Frames that are run first, so that nothing is compiled while the clock runs."""


@dataclass(frozen=True)
class Forecast:
    """What a run will cost.

    Attributes
    ----------
    frames, segments, workers
        Of the run, of which each segment is made by one worker.
    counting, learning, tracking, joining
        Seconds of work: decoding all streams once, learning backgrounds, making all segments, writing the run file.
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
    rig: Path,
    /,
    *,
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    config: Path | None = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", metavar="STAGE.KEY=VALUE", negative="")] = (),
    tracker: str = "cut",
    volume: VolumeKind = "all",
    workers: int = 1,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Say how long a run will take and how large its file will be, from ten seconds of this recording.

    Example: stseg plan rig.toml --workers 4

    It counts the recording, as the run will, and tracks three short parts of it. The other options are those of stseg
    run. Workers are taken to have a core each.

    Parameters
    ----------
    rig
        The rig file.
    frames
        Part of the recording, half open.
    config
        A TOML file with constants of the stages.
    set_
        One constant; may be given several times.
    tracker
        cut or frames.
    volume
        What of the volume is kept: all, tracks or none.
    workers
        Processes that will share the work.
    as_json
        Print numbers for a program: seconds and bytes.
    """
    if workers < 1:
        raise ConfigError("--workers", "", workers, "1 or more processes")
    recording, resolved = read_rig(rig), read_config(config, set_)
    start = perf_counter()
    streams = index_streams(recording)
    counting = perf_counter() - start
    for note in streams.notes:
        print(f"stseg: {note}", file=sys.stderr)
    first, stop = frame_range(frames, streams, recording)
    job = Job(recording, resolved, tracker, volume, first, stop, streams)
    told = forecast(job, counting, workers)
    print(json.dumps(asdict(told) | {"seconds": told.seconds}, indent=1) if as_json else _text(told, recording))


def forecast(job: Job, counting: float, workers: int) -> Forecast:
    """What a job will cost, from parts of it that are tracked now; counting took so many seconds."""
    work, cuts = SegmentWorker(job), job.segments()
    frames = sum(segment.stop - segment.first for segment in cuts)
    parts = list(_parts(job))
    tried = sum(len(range(part.first, part.stop)) for part in parts)
    with TemporaryDirectory() as name:
        folder = Path(name)
        work.make(replace(parts[0], stop=min(parts[0].first + _READY, job.stop)), folder / "ready.h5", _untold)
        tracking, learning, made, fused = 0.0, [], [], _Count()
        for part in parts:
            watch = _Clock()
            work.sights(part)
            learning.append(watch.lap())
            made.append(FinishedSegment(part, work.make(part, folder / f"{part.index}.h5", fused)))
            tracking += watch.lap()
        watch = _Clock()
        assemble(job, work.pipeline, made, folder / "run.h5", overwrite=True)
        joining, size = watch.lap(), (folder / "run.h5").stat().st_size
    # A segment looks on until its last window is solved, which is much of a short part and little of a long one.
    beyond = (fused.calls - tried) / len(parts)
    looked_at = sum(segment.stop - segment.lead + beyond for segment in cuts)
    learned = -(-frames // round(job.config.segments.background_period * job.recording.rig.frame_rate))
    return Forecast(
        frames, len(cuts), workers, counting, max(learning) * learned, tracking / fused.calls * looked_at,
        joining / tried * frames, round(size / tried * frames),
    )  # fmt: skip


def _parts(job: Job) -> list[Segment]:
    """Short parts spread over the run, without a warm-up."""
    total, length = job.stop - job.first, max(1, round(_SECONDS / _PLACES * job.recording.rig.frame_rate))
    length = min(length, max(1, total // _PLACES))
    begins = [job.first + (total - length) * place // (_PLACES - 1) for place in range(_PLACES)]
    return [Segment(k, begin, begin, begin + length) for k, begin in enumerate(begins) if k == 0 or total > _PLACES]


class _Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self._last = perf_counter()

    def lap(self) -> float:
        """Since the last lap."""
        last, self._last = self._last, perf_counter()
        return self._last - last


class _Count:
    """How often it is called: once for each frame that is looked at."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, _: int) -> None:
        self.calls += 1


def _untold(_: int) -> None:
    """Nobody is told how far it is."""


def _text(told: Forecast, recording: Recording) -> str:
    hours = told.frames / recording.rig.frame_rate / 3600
    shares = ("counting", told.counting), ("backgrounds", told.learning), ("tracking", told.tracking)
    parts = ", ".join(f"{name} {_span(seconds)}" for name, seconds in (*shares, ("writing the run file", told.joining)))
    size = told.file_bytes / 2**20
    return "\n".join(
        [
            f"recording   {told.frames} frames, {_span(hours * 3600)}, in {told.segments} segments",
            f"run         {_span(told.seconds)} with {told.workers} workers, a core each",
            f"work        {parts}",
            f"run file    {size:.0f} MiB, {size / hours:.0f} MiB an hour; as much again beside it until it stands",
        ]
    )


def _span(seconds: float) -> str:
    """Seconds, minutes or hours."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"
