"""`stseg run`: track the people of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from stseg.arrays import Bytes, Rows
from stseg.commands.sights import make_sights
from stseg.errors import ConfigError
from stseg.io.config_file import format_config, read_config
from stseg.io.frames import count_frames, open_frames
from stseg.io.layout import ghost_type
from stseg.io.outputs import require_new
from stseg.io.recording import Recording
from stseg.io.rigs import read_rig
from stseg.io.runs import RunWriter
from stseg.pipeline import Pipeline, Step
from stseg.tracks import EVENT, TRAJECTORY, Tracks


def run(
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    config: Path | None = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", metavar="STAGE.KEY=VALUE", negative="")] = (),
    tracker: str = "cut",
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Track the people of a recording, and write everything that was found to one HDF5 file.

    Example: stseg run rig.toml -o run.h5

    Then: stseg inspect run.h5, stseg report run.h5 -o report.html, stseg export run.h5 --to csv -o tracks.csv

    Parameters
    ----------
    rig
        The rig file: cameras, their recordings and the ground that they watch.
    output
        The run file to write.
    frames
        Part of the recording, half open; 0:100 are the first hundred frames. Frames keep their numbers.
    config
        A TOML file with constants of the stages, one table a stage.
    set_
        One constant, for example --set ghosts.person=-2; may be given several times.
    tracker
        cut: graph cuts of windows of the volume. frames: the people of each frame as they come, without a cut.
        kalman: a filter for each of them (HW12). particles: followed by the colours of their clothes (KD06).
        belief: by colours in each view, the views telling each other (DP06).
    overwrite
        Replace an older run file of that name, once this one is whole.
    """
    require_new(output, overwrite)
    resolved = read_config(config, set_)
    recording = read_rig(rig)
    first, stop = _frames(frames, recording)
    sights = make_sights(recording, resolved, first, stop)
    kinds = ["boxes" if s.source.kind in ("boxes", "instances") else "pixels" for s in recording.sources]
    pipeline = Pipeline(recording.rig, sights, kinds, resolved, tracker)
    views: Bytes = pipeline.occupancy.views
    with RunWriter(output, recording, views, format_config(resolved), overwrite=overwrite) as writer:
        tracks = _follow(pipeline, recording, first, stop, writer)
    people = len(np.unique(tracks.trajectory["id"]))
    print(f"{output}: {people} tracks in frames {first} to {stop - 1}")


def _follow(pipeline: Pipeline, recording: Recording, first: int, stop: int, writer: RunWriter) -> Tracks:
    """Write step by step, then what only the whole run tells."""
    trajectory: list[Rows] = [np.zeros(0, TRAJECTORY)]
    events: list[Rows] = [np.zeros(0, EVENT)]
    with open_frames(recording, first, stop) as moments, _progress(first, stop) as advance:
        for step in pipeline.steps(moments, first, advance):
            _write(step, writer, len(recording.sources))
            trajectory.append(step.commit.trajectory)
            events.append(step.commit.events)
    committed = np.concatenate(trajectory)
    tracks, identity = pipeline.finished(committed, np.concatenate(events))
    writer.relabel(committed["frame"], committed["id"], identity)
    writer.append("trajectory", tracks.trajectory)
    writer.append("boxes", tracks.boxes)
    writer.append("events", tracks.events)
    writer.finish(tracks.summary())
    return tracks


def _write(step: Step, writer: RunWriter, views: int) -> None:
    commit = step.commit
    frames = np.array([scene.frame for scene in commit.scenes])
    writer.append_frames(frames, np.stack([scene.log_odds for scene in commit.scenes]), commit.label)
    ghosts = np.zeros(len(step.candidates), ghost_type(views))
    for name in step.candidates.dtype.names or ():
        ghosts[name] = step.candidates[name]
    ghosts["parts"] = step.parts
    writer.append("ghosts", ghosts)
    writer.append("windows", commit.windows)
    writer.append("rates", step.rates)
    writer.append("timings", step.timings)


def _frames(text: str | None, recording: Recording) -> tuple[int, int]:
    """First and stop of the run; the recording's length is counted by decoding."""
    length = count_frames(recording)
    if text is None:
        return 0, length
    head, colon, tail = text.partition(":")
    if not colon or not all(part == "" or part.isdecimal() for part in (head, tail)):
        raise ConfigError("--frames", "", repr(text), "A:B, two whole numbers, half open")
    first, stop = int(head or 0), int(tail or length)
    if not first < stop <= length:
        raise ConfigError("--frames", "", repr(text), f"a part of the recording's frames, 0:{length}")
    return first, stop


@contextmanager
def _progress(first: int, stop: int) -> Iterator[_Advance]:
    """A bar on a terminal; silence in a log."""
    console = Console(stderr=True)
    columns: Sequence[TextColumn | BarColumn | TaskProgressColumn | TimeElapsedColumn | TimeRemainingColumn] = (
        TextColumn("tracking"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        yield _Advance(bar, bar.add_task("tracking", total=stop - first), first)


class _Advance:
    def __init__(self, bar: Progress, task: object, first: int) -> None:
        self.bar, self.task, self.first = bar, task, first

    def __call__(self, frame: int) -> None:
        self.bar.update(self.task, completed=frame - self.first + 1)  # type: ignore[arg-type]
