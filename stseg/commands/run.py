"""`stseg run`: track the people of a recording."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from stseg.commands.labels import require_pixels, write_labels
from stseg.commands.progress import TerminalReporter, frame_bar
from stseg.engine.assembly import FinishedSegment, assemble
from stseg.engine.cluster import make_by_cluster
from stseg.engine.following import follow as follow_recording
from stseg.engine.following import last_frame, live_table_of
from stseg.engine.segment import Job, SegmentWorker, VolumeKind
from stseg.engine.segments import Segment
from stseg.engine.warnings import rig_warnings
from stseg.engine.workers import make_by_workers
from stseg.errors import ConfigError
from stseg.io.config_file import format_config, read_config
from stseg.io.live.live_frames import is_live
from stseg.io.outputs.label_images import require_label_folder
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig
from stseg.io.recording.stream_index import StreamIndex, index_streams
from stseg.io.runfile.provenance import gather_provenance, run_request
from stseg.io.runfile.runs import read_run
from stseg.io.runfile.work_folder import WorkFolder


def run(
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    config: Path | None = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", metavar="STAGE.KEY=VALUE", negative="")] = (),
    tracker: str = "cut",
    volume: VolumeKind = "all",
    labels: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    workers: int = 1,
    scheduler: str | None = None,
    follow: Annotated[bool, Parameter(negative="")] = False,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Track the people of a recording, and write everything that was found to one HDF5 file.

    Example: stseg run rig.toml -o run.h5

    Then: stseg inspect run.h5, stseg report run.h5 -o report.html, stseg export run.h5 --to csv -o tracks.csv

    What is done is kept in the folder run.h5.segments until the run file stands: a run that was stopped or killed goes
    on from there when the same command is given again.

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
        One constant, for example --set detection.prior_log_odds=-2; may be given several times.
    tracker
        cut: graph cuts of windows of the volume. frames: the people of each frame as they come, without a cut.
        kalman: a filter for each of them (HW12). particles: followed by the colours of their clothes (KD06).
        belief: by colours in each view, the views telling each other (DP06).
    volume
        What of the occupancy volume is kept: all of it, what is within a metre of tracks, or none.
    labels
        Write afterwards for every pixel of every camera whom it shows, as stseg labels does, to this folder.
    workers
        Processes that share the work on this machine; the result is the same for any number.
    scheduler
        Address of a Dask scheduler whose workers share the work instead, such as tcp://10.0.0.5:8786.
    follow
        The recording still goes on: the path of every source is a pattern of videos that arrive (cam1_*.mp4), or every
        one an address (rtsp://...). The tracks of each window are added to run.h5.live.csv as soon as it is decided.
        Ctrl-C or SIGTERM finishes the run file; --frames 0:B ends it by itself.
    overwrite
        Replace an older run file of that name, once this one is whole.
    """
    require_new(output, overwrite)
    if workers < 1:
        raise ConfigError("--workers", "", workers, "1 or more processes")
    resolved, recording = read_config(config, set_), read_rig(rig)
    if labels is not None:
        require_pixels(recording)
        require_label_folder(labels, overwrite)
    asked = run_request(gather_provenance(recording, format_config(resolved)))
    asked |= {"--frames": frames or "all", "--tracker": tracker, "--volume": volume}
    if follow:
        _require_alone(workers, scheduler, labels)
        job = Job(recording, resolved, tracker, volume, 0, last_frame(frames), StreamIndex(0, ()))
        print(_follow(job, asked, output, overwrite))
        return
    with WorkFolder(output, asked) as folder, _told_how_to_go_on(folder):
        streams = _streams(recording, folder)
        for note in streams.notes:
            print(f"stseg: {note}", file=sys.stderr)
        first, stop = frame_range(frames, streams, recording)
        job = Job(recording, resolved, tracker, volume, first, stop, streams)
        plan = job.segments()
        for begin, end in job.gaps():
            print(
                f"stseg: no camera shows frames {begin} to {end - 1}: a gap, at which all tracks end", file=sys.stderr
            )
        if not plan:
            raise ConfigError("--frames", "", f"{first}:{stop}, which no camera shows", "a part that some camera shows")
        made = _make(job, plan, folder, Workforce(workers, scheduler))
        tracks = assemble(job, job.pipeline(), made, output, overwrite)
        folder.remove()
    people = len(np.unique(tracks.trajectory["id"]))
    for warning in rig_warnings(read_run(output)):
        print(f"stseg: warning: {warning}", file=sys.stderr)
    print(f"{output}: {people} tracks in frames {first} to {stop - 1}")
    if labels is not None:
        done = read_run(output)
        print(f"{labels}: {write_labels(done, resolved, labels, done.frames, overwrite)} label images")


def _follow(job: Job, asked: dict[str, Any], output: Path, overwrite: bool) -> str:
    """What there is to say of a run that followed a recording; its files change while it goes on."""
    is_live(job.recording)  # or it cannot be followed
    del asked["source"], asked["--frames"]
    work, table = WorkFolder(output, asked | {"--follow": "yes"}), live_table_of(output)
    if not work.begun:
        require_new(table, overwrite)
    with work as folder, _told_how_to_go_on(folder):
        try:
            told = follow_recording(job, folder, output, overwrite, TerminalReporter())
        except BaseException:
            if not folder.segments():  # nothing goes on from it
                table.unlink(missing_ok=True)
            raise
        folder.remove()
    return told


def _require_alone(workers: int, scheduler: str | None, labels: Path | None) -> None:
    for name, given in (("--workers", workers > 1), ("--scheduler", scheduler), ("--labels", labels)):
        if given:
            raise ConfigError(name, "", "that beside --follow", "one of them: a recording that goes on has one worker")


def frame_range(text: str | None, streams: StreamIndex, recording: Recording) -> tuple[int, int]:
    """First and stop of a part of a recording; where no text says which, of all that tells of places.

    Raises
    ------
    ConfigError
        Where the text is no part of it.
    """
    if text is None:
        return streams.multi_view_range(recording)
    length = streams.length
    head, colon, tail = text.partition(":")
    if not colon or not all(part == "" or part.isdecimal() for part in (head, tail)):
        raise ConfigError("--frames", "", repr(text), "A:B, two whole numbers, half open")
    first, stop = int(head or 0), int(tail or length)
    if not first < stop <= length:
        raise ConfigError("--frames", "", repr(text), f"a part of the recording's frames, 0:{length}")
    return first, stop


def _make(job: Job, plan: list[Segment], folder: WorkFolder, workforce: Workforce) -> list[FinishedSegment]:
    """All segments, those that are there already taken as they are."""
    kept = folder.segments()
    for path in folder.broken:
        print(f"stseg: {path}: its bytes have changed since it was written; made anew", file=sys.stderr)
    if kept:
        print(f"stseg: {len(kept)} of {len(plan)} segments are there already", file=sys.stderr)
    missing = [segment for segment in plan if segment.index not in kept]
    done = job.stop - job.first - sum(segment.stop - segment.first for segment in missing)
    with frame_bar("tracking", job.stop - job.first, done) as advance:
        for segment, path in workforce.make(job, missing, folder, advance):
            kept[segment.index] = path
    return [FinishedSegment(segment, kept[segment.index]) for segment in plan]


@dataclass(frozen=True)
class Workforce:
    """Who makes the segments: this process, several of this machine, or the workers of a scheduler."""

    workers: int
    scheduler: str | None

    def make(
        self, job: Job, missing: list[Segment], folder: WorkFolder, advance: Callable[[int], None]
    ) -> Iterator[tuple[Segment, Path]]:
        """Segments and their files, as they are done."""
        if not missing:
            return
        if self.scheduler is not None:
            yield from make_by_cluster(job, missing, folder.draft, self.scheduler, advance)
        elif self.workers > 1:
            yield from make_by_workers(job, missing, folder.draft, self.workers, advance)
        else:
            work = SegmentWorker(job)
            for segment in missing:
                yield segment, work.make(segment, folder.draft(segment.index), advance)


def _streams(recording: Recording, folder: WorkFolder) -> StreamIndex:
    """What counting the recording tells; it is counted once, by decoding."""
    known = folder.streams()
    if known is None:
        with frame_bar("counting", None):
            known = index_streams(recording)
        folder.keep_streams(known)
    return known


@contextmanager
def _told_how_to_go_on(folder: WorkFolder) -> Iterator[None]:
    """Where something stops a run of which segments are kept, a line says so."""
    try:
        yield
    except BaseException:
        if number := len(folder.segments()):
            told = f"{number} finished segments are kept in {folder.path}; the same command goes on from there"
            print(f"stseg: {told}", file=sys.stderr)
        else:
            folder.remove()
        raise
