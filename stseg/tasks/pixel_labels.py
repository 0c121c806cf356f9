"""`stseg.label_images`: for every pixel of every camera, the track that it shows."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from stseg.arrays import Bytes, Ints, Observation, Rows, Singles, ground_of
from stseg.config import Config
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.engine.offline.frame_range import FrameSpan, frames_of_run
from stseg.engine.recordings import run_of
from stseg.engine.reporter import AnyReporter, Reporter, reporter_of
from stseg.errors import SourceError
from stseg.io.config_file import parse_config
from stseg.io.outputs.label_images import LabelImages
from stseg.io.outputs.whole_files import Inputs
from stseg.io.recording.frames import FrameSet, open_frames
from stseg.io.recording.recording import Recording
from stseg.io.runfile.runs import Run
from stseg.pixel_labels.appearance import ColourSums, ViewAppearance
from stseg.pixel_labels.label_likelihood import PlacedPeople
from stseg.pixel_labels.views import ViewLabels, view_labels
from stseg.records.track_heights import with_heights
from stseg.reporting.pictures.colours import track_palette

_LEARNING_FRAMES = 200
"""Frames, about, from which the colours of tracks are learned."""


def label_images(
    run: Run | Path | str,
    folder: Path | str,
    *,
    frames: FrameSpan = None,
    config: Config | None = None,
    changes: Sequence[str] = (),
    overwrite: bool = False,
    progress: AnyReporter = None,
) -> int:
    """Write the track id of every pixel of every camera as images, as `stseg labels` does.

    Parameters
    ----------
    run
        A finished run, or its file; the cameras' streams are read again.
    folder
        Folder of the images, FOLDER/CAMERA/000123.png for frame 123.
    frames
        (first, stop), half open; None for all frames of the run.
    config
        The constants of foreground and labels; None for those of the run.
    changes
        Constants other than those of the run, each SECTION.KEY=VALUE.
    overwrite
        Write into a folder that is not empty.
    progress
        As of `stseg.track`.

    Returns
    -------
    int
        Number of images.

    Raises
    ------
    InputError
        Where no camera delivers pixels, or a stream cannot be read.
    """
    found = run_of(run)
    if config is None:
        config = parse_config(found.provenance.config, f"{found.path}: the configuration", tuple(changes))
    chosen, reporter, cameras = frames_of_run(found, frames), reporter_of(progress), require_pixels(found.recording)
    people, largest = _people(with_heights(found.trajectory), chosen), int(found.trajectory["id"].max(initial=0))
    names, inputs = [found.cameras[k] for k in cameras], Inputs(found.files)
    images = LabelImages(Path(folder), names, largest, track_palette(), overwrite, inputs)
    views = view_labels(found.recording.rig, config.labels, config.body)
    colours = _appearances(found, views, people, chosen, reporter)
    foregrounds = make_foregrounds(found.recording, config, int(found.frames[0]), int(found.frames[-1]) + 1)
    count = 0
    for frame_set in _frame_sets(found, chosen, config.foreground.chosen.memory, reporter):
        for k in cameras:
            view = frame_set.views[k]
            pixels = foregrounds[k].pixels(view)
            if frame_set.frame in people:
                ids = _ids(views[k], people[frame_set.frame], pixels, view, colours.get(k))
                images.write(found.cameras[k], frame_set.frame, ids)
                count += 1
    return count


def require_pixels(recording: Recording) -> list[int]:
    """The cameras that deliver pixels; SourceError where none does."""
    sources = [feed.source for feed in recording.sources]
    found = [k for k, source in enumerate(sources) if source.kind != "boxes" and source.detector is None]
    if not found:
        raise SourceError(recording.path, "camera, source", "boxes alone", "a camera that delivers pixels")
    return found


def _people(trajectory: Rows, frames: Ints) -> dict[int, Rows]:
    """The rows of each frame."""
    order = np.argsort(trajectory["frame"], kind="stable")
    ends = [np.searchsorted(trajectory["frame"], frames, side, sorter=order) for side in ("left", "right")]
    parts = zip(frames.tolist(), *(end.tolist() for end in ends), strict=True)
    return {frame: trajectory[order[first:stop]] for frame, first, stop in parts}


def _frame_sets(
    run: Run, frames: Ints, memory: float, reporter: Reporter, stage: str = "labelling"
) -> Iterator[FrameSet]:
    """The frames, and before them as many as a background needs to adapt to the light (`memory`, seconds)."""
    first, stop = max(int(run.frames[0]), int(frames[0]) - round(memory * run.frame_rate)), int(frames[-1]) + 1
    with (
        open_frames(run.recording.without_images(), first, stop) as frame_sets,
        reporter.progress(stage, stop - first) as advance,
    ):
        for frame_set in frame_sets:
            yield frame_set
            advance(1)


def _appearances(
    run: Run, views: Sequence[ViewLabels], people: dict[int, Rows], frames: Ints, reporter: Reporter
) -> dict[int, ViewAppearance]:
    """Colours of the tracks in each view that delivers colours, learned from frames all over the selection."""
    tracks = np.unique(np.concatenate([rows["id"] for rows in people.values()])).astype(np.int64)
    kinds = [source.source.kind for source in run.recording.sources]
    colours = {k: ColourSums.of(tracks) for k, kind in enumerate(kinds) if kind in ("video", "images")}
    if not colours or not len(tracks):
        return {}
    step = max(len(frames) // _LEARNING_FRAMES, 1)
    for frame_set in _frame_sets(run, frames, 0.0, reporter, "learning colours"):
        if (frame_set.frame - int(frames[0])) % step == 0:
            for k, sums in colours.items():
                image = _colours(frame_set.views[k])
                if image is not None:
                    views[k].learn(_placed(people[frame_set.frame]), image, sums)
    return {k: sums.appearance() for k, sums in colours.items()}


def _ids(
    view: ViewLabels, people: Rows, pixels: Singles | None, observation: Observation, colours: ViewAppearance | None
) -> Ints:
    """Ids of the tracks that a view shows, int64 (v, u); all 0 for a blind view."""
    if pixels is None:
        return np.zeros(view.camera.size[::-1], np.int64)
    index = view.label(_placed(people), pixels, _colours(observation), colours)
    return np.asarray(np.append(0, people["id"])[index], np.int64)


def _placed(people: Rows) -> PlacedPeople:
    covariance = np.stack([people[name] for name in ("xx", "xy", "xy", "yy")], -1).reshape(-1, 2, 2)
    ground, height = ground_of(people), people["height"].astype(float)
    return PlacedPeople(ground, covariance, height, people["id"].astype(np.int64))


def _colours(observation: Observation) -> Bytes | None:
    """The image of an observation that has colours."""
    return np.asarray(observation, np.uint8) if isinstance(observation, np.ndarray) and observation.ndim == 3 else None
