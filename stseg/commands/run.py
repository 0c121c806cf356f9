"""`stseg run`: track the people of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from stseg.commands.options import Frames, Settings
from stseg.commands.terminal.counts import counted
from stseg.engine.workers.worker_processes import prepare_workers
from stseg.errors import ConfigError
from stseg.io.runfile.layout import SUFFIXES, VolumeKind

if TYPE_CHECKING:
    from stseg.io.runfile.runs import Run


def run(
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    frames: Frames = None,
    config: Path | None = None,
    set_: Settings = (),
    tracker: str = "cut",
    volume: VolumeKind = "all",
    labels: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    workers: int | None = None,
    scheduler: str | None = None,
    follow: Annotated[bool, Parameter(negative="")] = False,
    publish: Annotated[str | None, Parameter(metavar="ADDRESS")] = None,
    known: Annotated[Path | None, Parameter(metavar="RUN.h5")] = None,
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
        After the run, write the track id of every pixel of every camera to this folder, as stseg labels does.
    workers
        Processes that share the work on this machine, by default one per core as far as memory allows; the result is
        the same for any number.
    scheduler
        Address of a Dask scheduler whose workers share the work instead, such as tcp://10.0.0.5:8786.
    follow
        The recording still goes on: the path of every source is a pattern of videos that arrive (cam1_*.mp4), or every
        one an address (rtsp://...). The tracks of each window are added to run.h5.live.csv as soon as it is decided.
        Ctrl-C or SIGTERM finishes the run file; --frames 0:B ends it by itself.
    publish
        With --follow: send the same tracks as JSON lines, one message a window, to mqtt://HOST[:PORT]/TOPIC (needs
        paho-mqtt), over a WebSocket to ws://HOST[:PORT]/PATH or wss://HOST/PATH (needs websockets), or by POST to
        http://HOST/PATH: --publish ws://localhost:8765/tracks, for instance. Tracking never waits for the receiver.
    known
        A run file of earlier the same day, by the same cameras: its people are recognised by height and colours and
        keep their ids, with --set tracking.return_probability=0.99; everybody else gets a greater one.
    overwrite
        Replace an older run file of that name, once this one is whole.
    """
    if output.suffix.lower() not in SUFFIXES and not output.exists():
        raise ConfigError("-o", "", str(output), "a run file, NAME.h5; stseg export writes tracks as csv and others")
    if scheduler is None and not follow:
        prepare_workers(workers)  # they import the stages while this process does: nothing is imported before
    from stseg.commands.terminal.standard_error import TerminalReporter, warn
    from stseg.engine.offline.frame_range import FrameRange
    from stseg.engine.track import track_recording
    from stseg.engine.workers.workforce import Workforce
    from stseg.io.config_file import read_config
    from stseg.io.recording.rigs import read_recording
    from stseg.tasks.warnings import run_warnings, source_warnings

    chosen, workforce = FrameRange.parsed(frames), Workforce(workers, scheduler)
    resolved, recording, reporter = read_config(config, set_), read_recording(rig), TerminalReporter()
    receiver = None
    if publish is not None:
        from stseg.io.live.publishing import receiver_of  # most runs send nothing

        receiver = receiver_of(publish)
    if receiver is not None and not follow:
        raise ConfigError("--publish", "", "that alone", "--follow with it; stseg export writes finished runs")
    if follow:
        from stseg.engine.live.following import follow_recording

        _require_alone(workers, scheduler, labels, known)
        followed = follow_recording(
            recording, output, resolved, tracker, volume, chosen, reporter, publish=receiver, overwrite=overwrite
        )
        if followed is None:
            print(f"{output}: not written, since nothing came")
        else:
            warn(followed.run.warnings)
            print(f"{_summary(followed.run)}{followed.delay}")
        return
    if labels is not None:
        from stseg.io.outputs.label_images import require_label_folder
        from stseg.io.outputs.whole_files import Inputs
        from stseg.io.recording.source_files import recording_files
        from stseg.tasks.pixel_labels import label_images, require_pixels

        pixels, inputs = require_pixels(recording), Inputs(recording_files(recording))
        require_label_folder(labels, [recording.rig.cameras[k].name for k in pixels], overwrite, inputs)
    earlier = source_warnings(recording)
    reporter = TerminalReporter(earlier)
    done = track_recording(
        recording, output, resolved, tracker, volume, chosen, workforce, reporter, known=known, overwrite=overwrite
    )
    warn(words for words in run_warnings(done, earlier) if words not in earlier)
    print(_summary(done))
    if labels is not None:
        count = label_images(done, labels, config=resolved, overwrite=overwrite, progress=reporter)
        print(f"{labels}: {count} label images")


def _require_alone(workers: int | None, scheduler: str | None, labels: Path | None, known: Path | None) -> None:
    for name, given in (
        ("--workers", workers is not None and workers > 1),
        ("--scheduler", scheduler),
        ("--labels", labels),
        ("--known", known),
    ):
        if given:
            raise ConfigError(name, "", "that beside --follow", "one of them: a recording that goes on has one worker")


def _summary(run: Run) -> str:
    people = len(set(run.trajectory["id"].tolist()))
    return f"{run.path}: {counted(people, 'track')} in frames {run.frames[0]} to {run.frames[-1]}"
