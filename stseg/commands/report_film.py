"""`stseg report --video`: a run as a film."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from pathlib import Path

from rich.console import Console
from rich.progress import track

from stseg.arrays import Bytes, Ints
from stseg.commands.run_frames import select_frames
from stseg.io.outputs.video_writer import write_film
from stseg.io.recording.frames import open_frames
from stseg.io.runfile.runs import Run
from stseg.reporting.pictures.film import Film


def film(run: Run, output: Path, part: str | None, camera_images: bool, overwrite: bool) -> int:
    """Write the film, and count its frames.

    Parameters
    ----------
    run
    output
        The video file.
    part
        Frames of the run, A:B, half open; None for all.
    camera_images
        Whether it shows the cameras' frames; the streams are not read without.
    overwrite
        Whether an older file may be replaced.

    Raises
    ------
    ConfigError
        Where the part is none of the run.
    OutputError, SourceError
    """
    frames = select_frames(run, part)
    shown = Film(run.recording.rig, run.views, run.trajectory)
    return write_film(output, _pictures(run, shown, frames, camera_images), run.frame_rate, overwrite)


def _pictures(run: Run, film: Film, frames: Ints, camera_images: bool) -> Iterator[Bytes]:
    console = Console(stderr=True)
    steps = track(frames.tolist(), "drawing", console=console, disable=not console.is_terminal, transient=True)
    if not camera_images:
        for frame in steps:
            yield film.picture(frame, tuple(repeat(None, len(run.cameras))))
        return
    with open_frames(run.recording.pictured(), int(frames[0]), int(frames[-1]) + 1) as frame_sets:
        wanted = iter(steps)
        frame = next(wanted, None)
        for frame_set in frame_sets:
            if frame_set.frame == frame:
                yield film.picture(frame_set.frame, frame_set.views)
                frame = next(wanted, None)
