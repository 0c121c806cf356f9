"""`stseg.track`: a recording to a run file, as the command `stseg run` does it."""

import shutil
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from stseg.config import Config
from stseg.config.keys import require_effect
from stseg.engine.memory import ground_note, require_memory
from stseg.engine.offline.assembly import FinishedSegment, assemble
from stseg.engine.offline.detector_sources import with_boxes
from stseg.engine.offline.due_segments import DueSegments
from stseg.engine.offline.frame_range import FrameRange, FrameSpan, resolve_frames
from stseg.engine.offline.job import Job
from stseg.engine.offline.known import digest, read_known
from stseg.engine.recordings import AnySource, config_of, recording_of
from stseg.engine.reporter import AnyReporter, Reporter, reporter_of
from stseg.engine.rig_body import with_body_of
from stseg.engine.workers.workforce import Workforce
from stseg.errors import ConfigError
from stseg.geometry import Rig
from stseg.identities.association import NO_KNOWN_PEOPLE
from stseg.io.config_file import as_toml
from stseg.io.machine import return_freed_memory
from stseg.io.outputs.whole_files import Inputs
from stseg.io.recording.aligned_stream import StreamIndex, index_streams
from stseg.io.recording.recording import Recording
from stseg.io.recording.source_files import recording_files
from stseg.io.runfile.layout import VolumeKind
from stseg.io.runfile.provenance import gather_provenance, run_request
from stseg.io.runfile.runs import Run, read_run
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.kernels.accelerate import compilation_noted


def track(
    rig: Path | str | Recording | Rig,
    output: Path | str | None = None,
    *,
    sources: Mapping[str, AnySource] | None = None,
    frames: FrameSpan = None,
    tracker: str = "cut",
    config: Config | Path | str | None = None,
    workers: int | None = 1,
    volume: VolumeKind = "all",
    known: Path | str | None = None,
    overwrite: bool = False,
    progress: AnyReporter = None,
) -> Run:
    """Track the people of a recording, as `stseg run` does.

    Parameters
    ----------
    rig
        The rig file (.toml): cameras, their recordings and the ground that they watch; or a recording; or a rig, with
        the sources of its cameras.
    output
        The run file to write; None for a temporary one, which is deleted with the returned run. An unfinished run of
        the same output is continued.
    sources
        Source of each camera of a `Rig` by the camera's name: the path of its boxes, images or video, or a
        `stseg.Source`, which masks and instance images need.
    frames
        (first, stop), half open; None at either place for the recording's first frame and its end. None for all.
    tracker
        Its name: cut, frames, kalman, particles or belief.
    config
        A configuration, or the path of a configuration file; None for the defaults.
    workers
        Processes that share the work, None for one per core as far as memory allows. The datasets are the same for any
        number. With several, a script needs `if __name__ == "__main__":`, as for every use of `multiprocessing`.
    volume
        The part of the occupancy volume that is kept: "all", "tracks" for a metre around tracks, or "none".
    known
        A run file of earlier the same day, whose people are recognised; see `stseg run --known`.
    overwrite
        Whether an older file of that name may be replaced.
    progress
        Called with the kind of work, the frames done, and the frames in all (None where not known). Notes go to the
        logger "stseg". Or a reporter, which receives both.

    Returns
    -------
    Run
        The finished run: tracks, events, detections and volume.

    Raises
    ------
    InputError
        As the command: one line with the file, the key, what was found and what was expected.
    """
    resolved, force = config_of(config), Workforce(workers)
    chosen, reporter = FrameRange.of(frames), reporter_of(progress)
    given = resolved, tracker, volume, chosen, force, reporter, None if known is None else Path(known)
    recording = recording_of(rig, sources)
    if output is not None:
        return track_recording(recording, Path(output), *given, overwrite=overwrite)
    folder = Path(mkdtemp(prefix="stseg-"))
    try:
        run = track_recording(recording, folder / "run.h5", *given)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    weakref.finalize(run, shutil.rmtree, folder, ignore_errors=True)
    return run


def track_recording(
    recording: Recording,
    output: Path,
    config: Config,
    tracker: str,
    volume: VolumeKind,
    frames: FrameRange | None,
    workforce: Workforce,
    reporter: Reporter,
    known: Path | None = None,
    *,
    overwrite: bool = False,
) -> Run:
    """As `track`, with what it has read: a recording, its configuration and frames, and the processes that are used.

    Raises
    ------
    InputError
        See `track`.
    """
    require_effect(config, tracker)
    config = with_body_of(recording, config)
    if workforce.scheduler is None:
        require_memory(recording.rig, config, recording.path)
        if note := ground_note(recording.rig):
            reporter.note(note)
    # Refused before people are searched in videos.
    WorkFolder(output, {}).require_output(overwrite, Inputs(recording_files(recording), [known]))
    recording = with_boxes(recording, output.with_name(f"{output.name}.boxes"), reporter, overwrite)
    people = NO_KNOWN_PEOPLE if known is None else read_known(known, config)
    request = run_request(recording, gather_provenance(recording, as_toml(config)))
    request |= {"--frames": "all" if frames is None else str(frames), "--tracker": tracker, "--volume": volume}
    request |= {"--known": "nothing" if known is None else digest(people)}
    work = WorkFolder(output, request)
    with work as folder, resumable(folder, reporter), compilation_noted(reporter.note):
        if not folder.published:
            workforce.prepare()
            streams = _indexed(recording, folder, reporter)
            first, stop = resolve_frames(frames, streams, recording)
            job = Job(recording, config, tracker, volume, first, stop, streams, people)
            finished = _make_segments(job, folder, workforce, reporter)
            assemble(job, finished, folder.result)
            return_freed_memory()
            folder.publish(overwrite)
        folder.remove()
    return read_run(output)


@contextmanager
def resumable(folder: WorkFolder, reporter: Reporter) -> Iterator[None]:
    """On an error, keep the work folder and note it where it holds segments; else remove it."""
    try:
        yield
    except BaseException as error:
        if number := len(folder.whole_segments()):
            reporter.note(f"{number} finished segments are kept in {folder.path}; the same command goes on from there")
        else:
            folder.remove()
            if isinstance(error, KeyboardInterrupt):
                reporter.note("no segment of the recording was finished: nothing is kept")
        raise


def _indexed(recording: Recording, folder: WorkFolder, reporter: Reporter) -> StreamIndex:
    """Lengths and frame times of all streams: every stream is decoded for them, once in an output's life."""
    streams = folder.streams(recording)
    if streams is None:
        with reporter.progress("counting", None):
            streams = index_streams(recording)
        folder.keep_streams(streams)
    for note in streams.notes:
        reporter.note(note)
    return streams


def _make_segments(job: Job, folder: WorkFolder, workforce: Workforce, reporter: Reporter) -> list[FinishedSegment]:
    """All segments of a job in the order of time; the missing ones are made."""
    plan = job.segments()
    due = DueSegments(plan, folder.whole_segments())
    for begin, end in job.gaps():
        reporter.note(f"no camera shows anything in frames {begin} to {end - 1}: a gap, at which all tracks end")
    if not plan:
        found = f"{job.first}:{job.stop}, which no camera shows"
        raise ConfigError("--frames", "", found, "a part that some camera shows")
    for path in folder.broken:
        reporter.note(f"{path}: its bytes have changed since it was written; made anew")
    if due.finished:
        reporter.note(f"{len(due.finished)} of {len(plan)} segments are there already")
    missing = [segment for segment in plan if segment.index not in due.finished]
    done = job.stop - job.first - sum(segment.stop - segment.first for segment in missing)
    with reporter.progress("tracking", job.stop - job.first, done) as advance:
        workforce.make(job, due, folder.draft, advance, reporter.note)
    return [FinishedSegment(segment, due.finished[segment.index]) for segment in plan]
