"""`stseg run --follow`: a recording that still goes on, in folders into which files arrive or as live streams."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain, takewhile
from pathlib import Path
from threading import Event

from stseg.accelerate import compilation_noted
from stseg.config import Config
from stseg.config.effect import require_effect
from stseg.engine.assembly import FinishedSegment, assemble
from stseg.engine.backgrounds import background_frames
from stseg.engine.frame_range import FrameRange
from stseg.engine.job import Job, VolumeKind
from stseg.engine.live_foreground import LiveForegrounds
from stseg.engine.live_run import LiveRun
from stseg.engine.reporter import Reporter
from stseg.engine.segments import Segment, endless_segments
from stseg.engine.stopping import stop_asked
from stseg.engine.track import resumable
from stseg.errors import ConfigError, SourceError
from stseg.io.config_file import format_config
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.followed_cameras import FollowedCameras
from stseg.io.live.followed_files import FollowedFiles
from stseg.io.live.live_frames import LiveFrameSet, is_live
from stseg.io.live.live_table import LiveTable
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.recording import Recording
from stseg.io.recording.stream_index import StreamIndex
from stseg.io.runfile.provenance import gather_provenance, run_request
from stseg.io.runfile.runs import Run, read_run
from stseg.io.runfile.work_folder import WorkFolder

ENDLESS = 1 << 62
"""Stop frame of a run whose end is not known yet."""


@dataclass(frozen=True)
class _Coming:
    """Frame sets to come, the segments of their frames, and the first frame of the first background period."""

    frame_sets: Iterable[LiveFrameSet]
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
    overwrite: bool = False,
) -> Followed | None:
    """Follow a recording until it is asked to stop, then write its run file.

    Parameters
    ----------
    recording, config, tracker, volume
        The input, see `stseg.engine.job.Job`.
    output
        The run file; tracks are added to `live_table_of(output)` while the recording goes on.
    frames
        0:B to end by itself; None to go on until a signal.
    reporter
        Receives notes and progress.
    overwrite
        Whether older files of those names may be replaced.

    Returns
    -------
    Followed or None
        None where nothing came, and no file was written.
    """
    require_effect(config, tracker)
    is_live(recording)  # or it cannot be followed
    job = Job(recording, config, tracker, volume, 0, last_frame(frames), StreamIndex(0, ()))
    request = run_request(recording, gather_provenance(recording, format_config(config)))
    request |= {"--tracker": tracker, "--volume": volume, "--follow": "yes"}
    del request["source"], request["samples of source"]  # its files change while it goes on
    work, table = WorkFolder(output, request), live_table_of(output)
    work.require_output(overwrite)
    if not work.begun:
        require_new(table, overwrite)
    with work as folder, resumable(folder, reporter), compilation_noted(reporter.note):
        try:
            followed = _follow(job, folder, output, overwrite, reporter)
        except BaseException:
            if not folder.segments():  # there is nothing to continue
                table.unlink(missing_ok=True)
            raise
        folder.remove()
    return followed


@dataclass(frozen=True)
class Followed:
    """A recording that was followed to its end.

    Attributes
    ----------
    run
        The run file.
    delay
        Time from the arrival of frames to their tracks in the live table, in words; empty where nothing was tracked.
    """

    run: Run
    delay: str


def _follow(job: Job, folder: WorkFolder, output: Path, overwrite: bool, reporter: Reporter) -> Followed | None:
    live = is_live(job.recording)
    finished = _kept(folder, live, reporter)
    stop = finished[-1].segment.stop if finished else 0
    total = None if job.stop == ENDLESS else job.stop
    with (
        stop_asked() as halt,
        LiveTable(live_table_of(output), job.recording.rig.frame_rate, stop) as table,
        reporter.progress("following", total, stop) as advance,
    ):
        follower = LiveRun(job, folder, table, LiveForegrounds(job.read, job.config), finished)
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
    assemble(whole, follower.pipeline, finished, folder.result)
    folder.publish(overwrite)
    return Followed(read_run(output), follower.delay)


def live_table_of(output: Path) -> Path:
    """Path of the live table: the tracks of a run while it goes on."""
    return output.with_name(f"{output.name}.live.csv")


def last_frame(frames: FrameRange | None) -> int:
    """The end of a run that follows, from its option --frames; `ENDLESS` without one. Raises ConfigError."""
    if frames is None:
        return ENDLESS
    if frames.first not in (None, 0) or not frames.stop:
        raise ConfigError("--frames", "", f"'{frames}'", "0:B with --follow, which begins where the recording does")
    return frames.stop


def _kept(folder: WorkFolder, live: bool, reporter: Reporter) -> list[FinishedSegment]:
    """The segments of an unfinished run. What is missing between those of files is made anew, with all after it."""
    found, made = folder.segments(), list[FinishedSegment]()
    for path in folder.broken:
        reporter.note(f"{path}: its bytes have changed since it was written; {'left out' if live else 'made anew'}")
    for index in sorted(found):
        if not live and index != len(made):
            found[index].unlink()
            continue
        frames = read_run(found[index]).frames
        first, stop = int(frames[0]), int(frames[-1]) + 1
        made.append(FinishedSegment(Segment(index, first, first, stop), found[index]))
    if made:
        reporter.note(f"{len(made)} segments are there already, up to frame {made[-1].segment.stop - 1}")
    return made


@contextmanager
def _files(
    job: Job, folder: WorkFolder, follower: LiveRun, halt: Event, reporter: Reporter
) -> Iterator[_Coming | None]:
    """Files that arrive, from where an unfinished run stopped; None where it is stopped before anything came."""
    recording, config, sights = job.read, job.config, follower.sights
    frame_rate, made = recording.rig.frame_rate, follower.made
    plan = endless_segments(frame_rate, config, 0)
    coming = [next(plan) for _ in range(len(made) + 1)][-1]
    if made and coming.first != made[-1].segment.stop:  # the last one was to be the end
        plan = endless_segments(frame_rate, config, made[-1].segment.stop, len(made))
        coming = next(plan)
    before = background_frames(coming, config.segments, frame_rate, 0, ENDLESS).before
    first = before.start if sights.learns else coming.lead
    notes = FileNotes(folder.path / "files.json")
    if sights.unlearned:
        with FollowedFiles(recording, first, None, config.live, notes, halt, reporter.note) as moments:
            if not _learn(sights, moments, config.live.background_time, reporter):
                yield None
                return
    stop = None if job.stop == ENDLESS else job.stop
    with FollowedFiles(recording, first, stop, config.live, notes, halt, reporter.note) as moments:
        yield _Coming(moments, chain([coming], plan), 0)


@contextmanager
def _cameras(
    job: Job, folder: WorkFolder, follower: LiveRun, halt: Event, reporter: Reporter
) -> Iterator[_Coming | None]:
    """Live streams from now on; None where it is stopped before anything came."""
    recording, config, sights = job.read, job.config, follower.sights
    with FollowedCameras(recording, config.live, folder.clock(), halt, reporter.note) as moments:
        if sights.unlearned and not _learn(sights, moments, config.live.background_time, reporter):
            yield None
            return
        begun = next(moments, None)
        if begun is None or moments.start is None:
            yield None
            return
        folder.keep_clock(moments.start)
        index = follower.made[-1].segment.index + 1 if follower.made else 0
        plan = endless_segments(recording.rig.frame_rate, config, begun.frame, index)
        until = takewhile(lambda moment: moment.frame < job.stop, chain([begun], moments))
        yield _Coming(until, plan, begun.frame)
        if moments.dropped:
            reporter.note(f"{moments.dropped} moments were dropped in all; /events says which")


def _learn(sights: LiveForegrounds, moments: Iterable[LiveFrameSet], seconds: float, reporter: Reporter) -> bool:
    """Teach the cameras that have no empty scene; False where the run is stopped before anything came."""
    reporter.note(f"no empty scene of {', '.join(sights.unlearned)}: learning from {seconds:g} s before the run begins")
    count = sights.learn(moments)
    if count and sights.unlearned:
        found = f"nothing in the first {count} frames"
        raise SourceError(
            f"camera {sights.unlearned[0]}", "", found, "a camera that shows something, or its empty scene"
        )
    return count > 0
