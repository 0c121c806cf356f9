"""`stseg report`: a run as one HTML page, as pictures and as a film."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from stseg.arrays import Observation, Rows
from stseg.commands.report_film import film
from stseg.errors import ConfigError
from stseg.io.answers import read_names
from stseg.io.outputs.output_files import make_folder, write_file, write_page
from stseg.io.outputs.video_writer import require_film_name
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.runfile.runs import Run, read_run
from stseg.io.track_csv import read_tracks_csv
from stseg.reporting.figures import Figure, Instant, camera_figures, ground_figures, slice_figures
from stseg.reporting.page.html import png_bytes
from stseg.reporting.page.page import report_page
from stseg.tasks.report_contents import page_contents

_MOMENTS = 3  # frames shown by default


def report(
    run_file: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], metavar="REPORT.html")] = None,
    truth: Path | None = None,
    frame: Annotated[tuple[int, ...], Parameter(negative="")] = (),
    pictures: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    video: Annotated[Path | None, Parameter(metavar="FILM.mp4")] = None,
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    camera_images: Annotated[bool, Parameter(negative="")] = False,
    names: Annotated[Path | None, Parameter(metavar="NAMES.csv")] = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Make an HTML page of a run that needs no other file and loads nothing, or a film of it.

    Example: stseg report night.h5 -o night.html --truth truth.csv --frame 60 --pictures night/

    Example: stseg report night.h5 --video night.mp4 --camera-images --frames 0:500

    The page shows the number of people, where they dwell, rejected ghosts with reasons, and where the rig is blind; a
    slider moves the plan, slices of the occupancy and the tracks in space and time. The film shows every view with its
    people as pillars, and the plan beside. No camera image is read or shown without --camera-images: the views then
    show the ruled ground.

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        The page to write.
    truth
        CSV with the columns frame,id,x,y (metres), drawn beside the tracks.
    frame
        A frame whose planes and camera views the page shows; may be given several times. Without it, the camera views
        of three frames of the run.
    pictures
        Folder to write the pictures to as well: plan.png, spacetime.png, slices.png, marginal.png and an
        overlay_CAMERA.png for each camera, and the maps density.png, dwell.png, flow.png, ghosts.png and blind.png.
        With several --frame, the frame's number is added to the name.
    video
        A film to write, MP4. It shows the cameras' frames with --camera-images, else pillars on the ruled ground.
    frames
        Part of the run that the film shows, half open.
    camera_images
        Show the cameras' frames under the tracks. Page, pictures and film then hold images of people.
    names
        CSV with the columns id,name: names of tracks in the page and its pictures.
    overwrite
        Replace the page, the pictures and the film if they exist.
    """
    _require_outputs(output, pictures, video, frames, overwrite)
    run = read_run(run_file)
    if names is not None:
        run = run.with_names(read_names(names))
    if output is not None:
        _write_page(run, output, truth, frame, pictures, camera_images, overwrite)
    if video is not None:
        count = film(run, video, frames, camera_images, overwrite)
        print(f"wrote {video}: {count} frames")


def _require_outputs(
    output: Path | None, pictures: Path | None, video: Path | None, frames: str | None, overwrite: bool
) -> None:
    """Refuse outputs that cannot be written and options without effect, before any work."""
    if output is None and video is None:
        raise ConfigError("command line", "", "nothing to write", "-o REPORT.html, or --video FILM.mp4")
    if output is None and pictures is not None:
        raise ConfigError("command line", "--pictures", pictures, "-o REPORT.html with it")
    if video is None and frames is not None:
        raise ConfigError("command line", "--frames", frames, "--video FILM.mp4 with it")
    for path in (output, video):
        if path is not None:
            require_new(path, overwrite)
    if video is not None:
        require_film_name(video)


def _write_page(
    run: Run,
    output: Path,
    truth: Path | None,
    frame: Sequence[int],
    pictures: Path | None,
    camera_images: bool,
    overwrite: bool,
) -> None:
    true = None if truth is None else _during(run, read_tracks_csv(truth))
    instants = _read_instants(run, run.recording, _frames(run, frame), camera_images)
    contents = page_contents(run, true, instants, bool(frame), camera_images)
    write_page(output, report_page(contents), overwrite)
    print(f"wrote {output}")
    if pictures is not None:
        shown = instants if frame else instants[len(instants) // 2 :][:1]
        figures = [*contents.still, *_named(run.recording, run, shown)]
        for path in _write_figures(pictures, figures, overwrite):
            print(f"wrote {path}")


def write_pictures(
    folder: Path, recording: Recording, run: Run, truth: Rows | None, frame: int, camera_images: bool = False
) -> list[Path]:
    """Write the report's pictures as PNG files, replacing older ones.

    Parameters
    ----------
    folder
        Made where it is not there.
    recording
        The rig and its streams; these are read with `camera_images` alone.
    run
    truth : (m,) with frame, id, x, y, or None
    frame
        The frame that slices and cameras show.
    camera_images
        Whether the overlays show the cameras' frames.

    Returns
    -------
    list of Path
        plan.png, spacetime.png, slices.png, marginal.png and overlay_CAMERA.png for each camera.

    Raises
    ------
    OutputError
        Where they cannot be written.
    SourceError
        Where the cameras' frames are asked for and cannot be read.
    """
    instants = _read_instants(run, recording, [frame], camera_images)
    ground = ground_figures(recording.rig, run.views, run.trajectory, truth, run.names)
    return _write_figures(folder, [*ground, *_named(recording, run, instants)], True)


def _frames(run: Run, asked: Sequence[int]) -> list[int]:
    """The frames to show, in order of time."""
    known = run.frames.tolist()
    for frame in asked:
        if frame not in known:
            some = f"a frame of the run, {known[0]} to {known[-1]}" if known else "none: the run is empty"
            raise ConfigError("command line", "--frame", frame, some)
    if asked or not known:
        return sorted(set(asked))
    middles = (2 * np.arange(_MOMENTS) + 1) * len(known) // (2 * _MOMENTS)
    return sorted({known[index] for index in middles.tolist()})


def _during(run: Run, truth: Rows) -> Rows:
    """The truth of the run's frames."""
    return truth[np.isin(truth["frame"], run.frames)]


def _read_instants(run: Run, recording: Recording, frames: Sequence[int], camera_images: bool) -> list[Instant]:
    unseen = (None,) * len(recording.rig.cameras)
    views = _read_views(recording, frames) if camera_images and frames else {}
    return [Instant(frame, *run.read_frame(frame), views.get(frame, unseen)) for frame in frames]


def _read_views(recording: Recording, frames: Sequence[int]) -> dict[int, tuple[Observation, ...]]:
    """What the cameras delivered at these frames, which are in order."""
    with open_frames(recording.pictured(), frames[0], frames[-1] + 1) as frame_sets:
        return {frame_set.frame: frame_set.views for frame_set in frame_sets if frame_set.frame in frames}


def _named(recording: Recording, run: Run, instants: Sequence[Instant]) -> list[Figure]:
    """Figures of these frames; where there are several, the frame is part of the name."""
    figures = []
    for instant in instants:
        own = [*slice_figures(recording.rig, instant), *camera_figures(recording.rig, run.trajectory, instant)]
        ending = f"_{instant.frame}" if len(instants) > 1 else ""
        figures += [replace(figure, name=figure.name + ending) for figure in own]
    return figures


def _write_figures(folder: Path, figures: Iterable[Figure], overwrite: bool) -> list[Path]:
    make_folder(folder)
    paths = []
    for figure in figures:
        paths.append(folder / f"{figure.name}.png")
        write_file(paths[-1], png_bytes(figure.picture), overwrite)
    return paths
