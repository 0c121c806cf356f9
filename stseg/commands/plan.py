"""`stseg plan`: how long a run will take and how large its file will be, before it is begun."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Frames, Settings
from stseg.commands.terminal.counts import counted
from stseg.commands.terminal.standard_error import TerminalReporter
from stseg.engine.offline.frame_range import FrameRange
from stseg.io.config_file import read_config
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_recording
from stseg.io.runfile.layout import VolumeKind
from stseg.tasks import forecast
from stseg.tasks.forecast import Forecast


def plan(
    rig: Path,
    /,
    *,
    frames: Frames = None,
    config: Path | None = None,
    set_: Settings = (),
    tracker: str = "cut",
    volume: VolumeKind = "all",
    workers: int | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Say how long a run will take and how large its file will be, from a few frames of this recording.

    Example: stseg plan rig.toml --workers 4

    It counts the recording, as the run will, and tracks frames at three places of it. The other options are those of
    stseg run. Workers share the cores of this machine; each has one at least.

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
        Processes that will share the work, by default one per core as far as memory allows.
    as_json
        Print numbers for a program: seconds and bytes.
    """
    recording = read_recording(rig)
    estimate = forecast.plan(
        recording,
        frames=FrameRange.parsed(frames),
        config=read_config(config, set_),
        tracker=tracker,
        volume=volume,
        workers=workers,
        progress=TerminalReporter(),
    )
    numbers = asdict(estimate) | {"seconds": estimate.seconds}
    print(json.dumps(numbers, indent=1) if as_json else _text(estimate, recording))


def _text(estimate: Forecast, recording: Recording) -> str:
    hours = estimate.frames / recording.rig.frame_rate / 3600
    names = {"starting": "start", "counting": "counting", "learning": "backgrounds", "tracking": "tracking"}
    names["joining"] = "writing the run file"
    parts = ", ".join(f"{words} {_span(getattr(estimate, name))}" for name, words in names.items())
    size, segments = estimate.file_bytes / 2**20, counted(estimate.segments, "segment")
    return "\n".join(
        [
            f"recording   {counted(estimate.frames, 'frame')}, {_span(hours * 3600)}, in {segments}",
            f"run         {_span(estimate.seconds)} with {counted(estimate.workers, 'worker')}",
            f"work        {parts}",
            f"run file    {size:.0f} MiB, {size / hours:.0f} MiB an hour; temporary files need the same space again",
        ]
    )


def _span(seconds: float) -> str:
    """Seconds, minutes or hours."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"
