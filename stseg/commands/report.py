"""`stseg report`: a run as one HTML page and as pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from stseg.arrays import Observation, Rows
from stseg.errors import ConfigError
from stseg.evaluation import evaluate
from stseg.io.frames import open_frames
from stseg.io.outputs import require_new
from stseg.io.pages import make_folder, write_file, write_page
from stseg.io.recording import Recording
from stseg.io.runs import Run, read_run
from stseg.io.tracks import read_tracks_csv
from stseg.report.charts import Span, clock_time
from stseg.report.figures import Figure, Instant, camera_figures, ground_figures, slice_figures
from stseg.report.page import Contents, png_bytes, report_page

_MOMENTS = 3  # shown where none are asked for


def report(
    run_file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="REPORT.html")],
    truth: Path | None = None,
    frame: Annotated[tuple[int, ...], Parameter(negative="")] = (),
    pictures: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    camera_images: Annotated[bool, Parameter(negative="")] = False,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Make an HTML page of a run that needs no other file and loads nothing.

    Example: stseg report night.h5 -o night.html --truth truth.csv --frame 60 --pictures night/

    It shows the tracks from above and in space and time, how many people there were, tracks and events, and slices of
    the occupancy volume and every camera's view at a few frames. No camera image is read or shown without
    --camera-images.

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        The page to write.
    truth
        CSV with the columns frame,id,x,y (metres), drawn beside the tracks.
    frame
        A frame to show; may be given several times. Without it, three frames of the run.
    pictures
        Folder to write the pictures to as well: plan.png, spacetime.png, slices.png, marginal.png and an
        overlay_CAMERA.png for each camera. With several --frame, the frame's number is added to the name.
    camera_images
        Show the cameras' frames under the tracks. The page and the pictures then hold images of people.
    overwrite
        Replace the page and the pictures if they exist.
    """
    require_new(output, overwrite)
    run = read_run(run_file)
    true = None if truth is None else _during(run, read_tracks_csv(truth))
    instants = _read_instants(run, run.recording, _frames(run, frame), camera_images)
    contents = _contents(run, true, instants, camera_images)
    write_page(output, report_page(contents), overwrite)
    print(f"wrote {output}")
    if pictures is not None:
        shown = instants if frame else instants[len(instants) // 2 :][:1]
        figures = [*contents.ground, *_named(run.recording, run, shown)]
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
    ground = ground_figures(recording.rig, run.views, run.trajectory, truth)
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
    with open_frames(recording, frames[0], frames[-1] + 1) as moments:
        return {moment.frame: moment.views for moment in moments if moment.frame in frames}


def _contents(run: Run, truth: Rows | None, instants: Sequence[Instant], camera_images: bool) -> Contents:
    rig = run.recording.rig
    first, stop = (int(run.frames[0]), int(run.frames[-1]) + 1) if len(run.frames) else (0, 1)
    span = Span(first, stop, run.frame_rate)
    return Contents(
        run.scene,
        [*_facts(run, span), *_scores(run.trajectory, truth)],
        span,
        run.trajectory,
        run.tracks,
        run.events,
        run.ghosts,
        truth,
        ground_figures(rig, run.views, run.trajectory, truth),
        [figure for instant in instants for figure in slice_figures(rig, instant)],
        [figure for instant in instants for figure in camera_figures(rig, run.trajectory, instant)],
        camera_images,
    )


def _facts(run: Run, span: Span) -> list[tuple[str, str]]:
    grid = run.recording.rig.grid
    computed = float(run.timings["seconds"].sum())
    return [
        ("tracks", str(len(run.tracks))),
        ("cameras", str(len(run.cameras))),
        ("frames", f"{span.first} to {span.stop - 1}"),
        ("length", clock_time((span.stop - span.first) / span.frame_rate)),
        ("frames per second", f"{span.frame_rate:g}"),
        ("ground", f"{grid.x[1] - grid.x[0]:g} m x {grid.y[1] - grid.y[0]:g} m"),
        ("cells", f"{grid.cell:g} m, {grid.planes} planes"),
        *([("computed in", clock_time(computed))] if computed > 0 else []),
    ]


def _scores(trajectory: Rows, truth: Rows | None) -> list[tuple[str, str]]:
    """How well the run agrees with the truth, within half a metre."""
    if truth is None or not len(truth):
        return []
    scores = evaluate(truth, trajectory)
    named = (("MOTA", scores.mota, " %"), ("IDF1", scores.idf1, " %"), ("HOTA", scores.hota, " %"))
    facts = [(name, f"{value:.1f}{unit}") for name, value, unit in named if value is not None]
    return facts if scores.location_mean is None else [*facts, ("mean error", f"{scores.location_mean:.3f} m")]


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
