"""`stseg.report`: a run as one HTML page, as pictures and as a film."""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np

from stseg.arrays import Bytes, Ints, Observation
from stseg.engine.offline.frame_range import FrameRange, FrameSpan, frames_of_run
from stseg.engine.recordings import run_of
from stseg.engine.reporter import AnyReporter, Reporter, reporter_of
from stseg.errors import ConfigError
from stseg.io.answers import read_names
from stseg.io.outputs.video_writer import require_film_name, write_film
from stseg.io.outputs.whole_files import Inputs, make_folder, require_output, write_file, write_png
from stseg.io.recording.aligned_stream import decoder_threads
from stseg.io.recording.frames import open_frames, read_camera
from stseg.io.recording.recording import Recording
from stseg.io.runfile.runs import Run
from stseg.io.track_csv import read_tracks_csv
from stseg.reporting.figures import Figure, Instant, RunFilm, camera_figures, slice_figures
from stseg.reporting.page.html import png_bytes
from stseg.reporting.page.page import report_page
from stseg.tasks.report_contents import page_contents

_DEFAULT_INSTANTS = 3
"""Number of frames that the page shows by default."""


def report(
    run: Run | Path | str,
    output: Path | str | None = None,
    *,
    truth: Path | str | None = None,
    frame: Sequence[int] = (),
    pictures: Path | str | None = None,
    video: Path | str | None = None,
    frames: FrameSpan = None,
    camera_images: bool = False,
    names: Path | str | None = None,
    overwrite: bool = False,
    progress: AnyReporter = None,
) -> list[Path]:
    """Write a run as an HTML page that needs no other file, or as a film, as `stseg report` does.

    Parameters
    ----------
    run
        The run, or its file.
    output
        The page to write, or None for the film alone.
    truth
        CSV with the columns frame,id,x,y (metres), drawn beside the tracks.
    frame
        Frames of which the page shows planes and camera views; empty for the camera views of three frames.
    pictures
        Folder to write the pictures of the page to as well.
    video
        A film to write, WebM or, in four times the time, MP4.
    frames
        (first, stop), half open: the part of the run that the film shows; None for all.
    camera_images
        Show the cameras' frames under the tracks. Page, pictures and film then hold images of people.
    names
        CSV with the columns id,name: names of tracks.
    overwrite
        Replace files that exist.
    progress
        As of `stseg.track`.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    InputError
        Where nothing is to be written, a file exists, or the run has no such frame.
    """
    page, folder, movie, true, named = (
        None if path is None else Path(path) for path in (output, pictures, video, truth, names)
    )
    found = run_of(run)
    inputs = Inputs(found.files, [true, named])
    _require_outputs(page, folder, movie, FrameRange.of(frames), overwrite, inputs)
    film_frames = np.zeros(0, np.int64) if movie is None else frames_of_run(found, frames)
    if named is not None:
        found = found.with_names(read_names(named))
    paths = [] if page is None else _write_page(found, page, true, frame, folder, camera_images, overwrite, inputs)
    if movie is not None:
        film = RunFilm(found.recording.rig, found.views, found.trajectory)
        drawn = _film_pictures(found, film, film_frames, camera_images, reporter_of(progress))
        write_film(movie, drawn, found.frame_rate, overwrite)
        paths.append(movie)
    return paths


def _require_outputs(
    output: Path | None,
    pictures: Path | None,
    video: Path | None,
    frames: FrameRange | None,
    overwrite: bool,
    inputs: Inputs,
) -> None:
    """Refuse outputs that cannot be written and options without effect, before any work."""
    if output is None and pictures is not None:
        raise ConfigError("command line", "--pictures", pictures, "-o REPORT.html with it")
    if output is None and video is None:
        raise ConfigError("command line", "", "nothing to write", "-o REPORT.html, or --video FILM.webm")
    if video is None and frames is not None:
        raise ConfigError("command line", "--frames", frames, "--video FILM.webm with it")
    for path in (output, video):
        if path is not None:
            require_output(path, overwrite, inputs)
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
    inputs: Inputs,
) -> list[Path]:
    """Write the page and its pictures, see `report`; the files that were written."""
    run.require_consistency()
    rows = None if truth is None else read_tracks_csv(truth)
    true = None if rows is None else rows[np.isin(rows["frame"], run.frames)]
    frames = _frames(run, frame)
    views = read_views(run.recording, frames) if camera_images and frames else {}
    unseen = (None,) * len(run.cameras)
    instants = [Instant(frame, *run.read_frame(frame), views.get(frame, unseen)) for frame in frames]
    contents = page_contents(run, true, instants, bool(frame), camera_images)
    write_file(output, report_page(contents).encode(), overwrite)
    if pictures is None:
        return [output]
    drawn = instants if frame else instants[len(instants) // 2 :][:1]
    still = [*contents.still, *_named(run, drawn)]
    return [output, *write_figures(pictures, still, overwrite, inputs)]


def _frames(run: Run, chosen: Sequence[int]) -> list[int]:
    """The frames to show, in order of time."""
    numbers = run.frames.tolist()
    for frame in chosen:
        if frame not in numbers:
            some = f"a frame of the run, {numbers[0]} to {numbers[-1]}" if numbers else "none: the run is empty"
            raise ConfigError("command line", "--frame", frame, some)
    if chosen or not numbers:
        return sorted(set(chosen))
    middles = (2 * np.arange(_DEFAULT_INSTANTS) + 1) * len(numbers) // (2 * _DEFAULT_INSTANTS)
    return sorted({numbers[index] for index in middles.tolist()})


def read_views(recording: Recording, frames: Sequence[int]) -> dict[int, tuple[Observation, ...]]:
    """Observations of these frames, which are in order, by frame; those between are skipped."""
    pictured = recording.pictured()
    with ThreadPoolExecutor(decoder_threads(pictured)) as pool:
        views = pool.map(lambda k: list(read_camera(pictured, k, frames)), range(len(pictured.sources)))
    return dict(zip(frames, zip(*views, strict=True), strict=True))


def _named(run: Run, instants: Sequence[Instant]) -> list[Figure]:
    """Figures of these frames; where there are several, the frame is part of the name."""
    rig, figures = run.recording.rig, []
    for instant in instants:
        drawn = [*slice_figures(rig, instant), *camera_figures(rig, run.trajectory, instant)]
        ending = f"_{instant.frame}" if len(instants) > 1 else ""
        figures += [replace(figure, name=figure.name + ending) for figure in drawn]
    return figures


def write_figures(folder: Path, figures: Iterable[Figure], overwrite: bool, inputs: Inputs) -> list[Path]:
    """Write figures as PNG files; their paths."""
    make_folder(folder)
    paths = []
    for figure in figures:
        paths.append(folder / f"{figure.name}.png")
        write_png(paths[-1], png_bytes(figure.picture), overwrite, inputs)
    return paths


def _film_pictures(run: Run, film: RunFilm, frames: Ints, camera_images: bool, reporter: Reporter) -> Iterator[Bytes]:
    with reporter.progress("drawing", len(frames)) as advance:
        if not camera_images:
            for frame in frames.tolist():
                yield film.picture(frame, tuple(repeat(None, len(run.cameras))))
                advance(1)
            return
        wanted = set(frames.tolist())
        with open_frames(run.recording.pictured(), int(frames[0]), int(frames[-1]) + 1) as frame_sets:
            for frame_set in frame_sets:
                if frame_set.frame in wanted:
                    yield film.picture(frame_set.frame, frame_set.views)
                    advance(1)
