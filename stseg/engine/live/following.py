"""Online tracking of a recording in progress (`stseg run --follow`): files that arrive in folders, or live streams."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from itertools import chain, takewhile
from pathlib import Path
from threading import Event

from stseg.config import Config
from stseg.config.keys import require_effect
from stseg.engine.live.live_foreground import LiveForegrounds
from stseg.engine.live.live_run import LiveRun
from stseg.engine.memory import require_memory
from stseg.engine.offline.assembly import FinishedSegment, assemble
from stseg.engine.offline.backgrounds import background_frames
from stseg.engine.offline.frame_range import FrameRange
from stseg.engine.offline.job import Job
from stseg.engine.offline.segments import Segment, endless_segments
from stseg.engine.reporter import Reporter
from stseg.engine.rig_body import with_body_of
from stseg.engine.stopping import stop_asked
from stseg.engine.track import resumable
from stseg.errors import ConfigError, SourceError
from stseg.io.config_file import as_toml
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.followed_cameras import FollowedCameras
from stseg.io.live.followed_files import FollowedFiles
from stseg.io.live.live_stream import is_live
from stseg.io.live.live_tables import COLUMNS, LIVE_HEADER, CorrectionTable, LiveTable
from stseg.io.live.publishing import Publisher, Receiver
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.aligned_stream import StreamIndex
from stseg.io.recording.frames import FrameSet
from stseg.io.recording.recording import Recording
from stseg.io.recording.source_files import recording_files
from stseg.io.runfile.layout import VolumeKind
from stseg.io.runfile.provenance import gather_provenance, run_request
from stseg.io.runfile.runs import Run, read_run
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.kernels.accelerate import compilation_noted
from stseg.tracking.windows.windows import ENDLESS


@dataclass(frozen=True)
class _Coming:
    """Future frame sets, the segments of their frames, and the first frame of the first background period."""

    frame_sets: Iterable[FrameSet]
    plan: Iterator[Segment]
    since: int


def follow_recording(
    recording: Recording,
    output: Path,
    config: Config,
    tracker: str,
    volume: VolumeKind,
    frames: FrameRange | None,
    reporter: Reporter,
    *,
    publish: Receiver | None = None,
    overwrite: bool = False,
) -> Followed | None:
    """Track a recording in progress until a stop is requested, then write its run file.

    As `track_recording`, but frames 0:B stop it before frame B, and None until a signal. `publish` receives the rows of
    `live_table_of(output)`, to which tracks are appended meanwhile, as JSON lines.

    Returns
    -------
    Followed or None
        None where no frame arrived, and no file was written.

    Raises
    ------
    SourceError
        Where the sources cannot be followed, or a camera to be trained delivers no images.
    """
    require_effect(config, tracker)
    config = with_body_of(recording, config)
    require_memory(recording.rig, config, recording.path)
    is_live(recording)  # raises where the sources cannot be followed
    job = Job(recording, config, tracker, volume, 0, last_frame(frames), StreamIndex(0, ()))
    request = run_request(recording, gather_provenance(recording, as_toml(config)))
    request |= {"--tracker": tracker, "--volume": volume, "--follow": "yes"}
    del request["source"], request["samples of source"]  # the files change during the run
    work, table = WorkFolder(output, request), live_table_of(output)
    inputs = Inputs(recording_files(recording))
    work.require_output(overwrite, inputs)
    if not work.begun:
        require_output(table, overwrite, inputs, LIVE_HEADER)
        require_output(live_corrections_of(output), overwrite, inputs, ",".join(COLUMNS))
    with work as folder, resumable(folder, reporter), compilation_noted(reporter.note):
        try:
            done = folder.published  # a kill came before the folder was removed
            followed = (
                Followed(read_run(output), "") if done else _follow(job, folder, output, overwrite, reporter, publish)
            )
        except BaseException:
            if not folder.whole_segments():  # nothing to resume
                table.unlink(missing_ok=True)
                live_corrections_of(output).unlink(missing_ok=True)
            raise
        folder.remove()
    return followed


@dataclass(frozen=True)
class Followed:
    """Result of a finished online run."""

    run: Run
    """The run file."""
    delay: str
    """Latency from the arrival of frames to their tracks in the live table, in words; empty without any tracks."""


def _follow(
    job: Job, folder: WorkFolder, output: Path, overwrite: bool, reporter: Reporter, receiver: Receiver | None
) -> Followed | None:
    live, rate = is_live(job.recording), job.recording.rig.frame_rate
    finished = _kept(folder, live, reporter)
    stop = finished[-1].segment.stop if finished else 0
    total = None if job.stop == ENDLESS else job.stop
    with (
        stop_asked() as halt,
        LiveTable(live_table_of(output), rate, stop) as table,
        nullcontext() if receiver is None else Publisher(receiver, rate, reporter.note) as publisher,
        reporter.progress("following", total, stop) as advance,
    ):
        corrections = CorrectionTable(live_corrections_of(output), stop)
        foregrounds = LiveForegrounds(job.read, job.config)
        follower = LiveRun(job, folder, table, corrections, publisher, foregrounds, finished)
        with follower, (_cameras if live else _files)(job, folder, follower, halt, reporter) as coming:
            if coming is not None:
                follower.begin(coming.plan, coming.since)
                for frame_set in coming.frame_sets:
                    follower.add(frame_set)
                    advance(1)
        finished = follower.finish()
    if not finished:
        table.path.unlink()
        return None
    whole = replace(job, first=finished[0].segment.first, stop=finished[-1].segment.stop)
    assemble(whole, finished, folder.result)
    folder.publish(overwrite)
    return Followed(read_run(output), follower.delay)


def live_table_of(output: Path) -> Path:
    """Path of the live table, the tracks of a run in progress."""
    return output.parent / f"{output.name}.live.csv"


def live_corrections_of(output: Path) -> Path:
    """Path of the table of ids of the live table that are corrected."""
    return output.parent / f"{output.name}.live_corrections.csv"


def last_frame(frames: FrameRange | None) -> int:
    """Stop frame of an online run from its option --frames; `ENDLESS` without one. Raises ConfigError."""
    if frames is None:
        return ENDLESS
    if frames.first not in (None, 0) or not frames.stop:
        raise ConfigError("--frames", "", f"'{frames}'", "0:B with --follow, which begins where the recording does")
    return frames.stop


def _kept(folder: WorkFolder, live: bool, reporter: Reporter) -> list[FinishedSegment]:
    """Finished segments of an interrupted run. Of files, those after a missing one are removed, to be made anew."""
    paths, finished = folder.whole_segments(), list[FinishedSegment]()
    for path in folder.broken:
        reporter.note(f"{path}: its bytes have changed since it was written; {'left out' if live else 'made anew'}")
    for index in sorted(paths):
        if not live and index != len(finished):
            paths[index].unlink()
            continue
        frames = read_run(paths[index]).frames
        first, stop = int(frames[0]), int(frames[-1]) + 1
        finished.append(FinishedSegment(Segment(index, first, first, stop), paths[index]))
    if finished:
        reporter.note(f"{len(finished)} segments are there already, up to frame {finished[-1].segment.stop - 1}")
    return finished


@contextmanager
def _files(
    job: Job, folder: WorkFolder, follower: LiveRun, halt: Event, reporter: Reporter
) -> Iterator[_Coming | None]:
    """Frame sets of arriving files, from the end of an interrupted run on; None if stopped before any frame arrived."""
    recording, config, foregrounds = job.read, job.config, follower.foregrounds
    frame_rate, finished = recording.rig.frame_rate, follower.finished
    plan = endless_segments(frame_rate, config, 0)
    coming = [next(plan) for _ in range(len(finished) + 1)][-1]
    if finished and coming.first != finished[-1].segment.stop:  # the interrupted run had ended there
        plan = endless_segments(frame_rate, config, finished[-1].segment.stop, len(finished))
        coming = next(plan)
    before = background_frames(coming, config.segments, frame_rate, 0, ENDLESS).before
    first = before.start if foregrounds.has_backgrounds else coming.lead
    notes = FileNotes(folder.path / "files.json")
    if foregrounds.has_backgrounds:
        with FollowedFiles(recording, first, None, config.live, notes, halt, reporter.note) as frame_sets:
            if _taught(foregrounds, iter(frame_sets), config.live.background_time, reporter) is None:
                yield None
                return
    stop = None if job.stop == ENDLESS else job.stop
    with FollowedFiles(recording, first, stop, config.live, notes, halt, reporter.note) as frame_sets:
        yield _Coming(frame_sets, chain([coming], plan), 0)


@contextmanager
def _cameras(
    job: Job, folder: WorkFolder, follower: LiveRun, halt: Event, reporter: Reporter
) -> Iterator[_Coming | None]:
    """Frame sets of live streams from now on; None if stopped before any frame arrived."""
    recording, config, foregrounds = job.read, job.config, follower.foregrounds
    with FollowedCameras(recording, config.live, folder.clock(), halt, reporter.note) as frame_sets:
        taught = _taught(foregrounds, frame_sets, config.live.background_time, reporter)
        begun = None if taught is None else next(taught, None)
        if begun is None or frame_sets.start is None:
            yield None
            return
        folder.keep_clock(frame_sets.start)
        index = follower.finished[-1].segment.index + 1 if follower.finished else 0
        plan = endless_segments(recording.rig.frame_rate, config, begun.frame, index)
        until = takewhile(lambda frame_set: frame_set.frame < job.stop, chain([begun], frame_sets))
        yield _Coming(until, plan, begun.frame)
        if frame_sets.dropped:
            reporter.note(f"{frame_sets.dropped} frame sets were dropped in all: see /events")


def _taught(
    foregrounds: LiveForegrounds, frame_sets: Iterator[FrameSet], seconds: float, reporter: Reporter
) -> Iterator[FrameSet] | None:
    """Teach the cameras without an empty scene that fits; the frame sets that follow, None if none came."""
    first = next(frame_sets, None)
    if first is None:
        return None
    foregrounds.see_first_light(first)
    frame_sets, names = chain([first], frame_sets), ", ".join(foregrounds.untrained)
    if not names:
        return frame_sets
    reporter.note(f"no empty scene that fits {names}: learning from {seconds:g} s before the run begins")
    count = foregrounds.learn(frame_sets)
    if foregrounds.untrained:
        camera, found = f"camera {foregrounds.untrained[0]}", f"nothing in the first {count} frames"
        raise SourceError(camera, "", found, "a camera that shows something, or its empty scene")
    return frame_sets
