"""`stseg labels`: for every pixel of every camera, which track it shows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import track

from stseg.arrays import Bytes, Ints, Observation, Rows, Singles
from stseg.commands.run_frames import frames_of_run
from stseg.config import Config
from stseg.engine.backgrounds import make_foregrounds
from stseg.errors import SourceError
from stseg.io.config_file import parse_config
from stseg.io.outputs.label_images import LabelImages
from stseg.io.recording.frames import FrameSet, open_frames
from stseg.io.recording.recording import Recording
from stseg.io.runfile.runs import Run, read_run
from stseg.labels.placed_people import PlacedPeople
from stseg.labels.views import ViewLabels, view_labels
from stseg.report.colours import track_colour


def labels(
    run_file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="FOLDER")],
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", metavar="STAGE.KEY=VALUE", negative="")] = (),
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write for every pixel of every camera which track it shows.

    Example: stseg labels night.h5 -o night_labels/

    The cameras' streams are read again, where the run file says they are. FOLDER/CAMERA/000123.png is the image of
    frame 123, as large as the camera's: ids of tracks, 0 for nobody; indexed, in the tracks' colours, or grey of 16
    bits where an id is above 255. Cameras that deliver boxes have no pixels, and no images.

    Parameters
    ----------
    run_file
        A run file (.h5).
    output
        Folder to write to.
    frames
        Part of the run, half open.
    set_
        One constant other than those of the run, for example --set labels.samples=32; may be given several times.
    overwrite
        Write into a folder that is not empty.
    """
    run = read_run(run_file)
    config = parse_config(run.provenance.config, f"{run_file}: the configuration", set_)
    count = write_labels(run, config, output, frames_of_run(run, frames), overwrite)
    print(f"{output}: {count} label images")


def write_labels(run: Run, config: Config, folder: Path, frames: Ints, overwrite: bool) -> int:
    """Write the label images of some frames of a run, and count them.

    Parameters
    ----------
    run
        A finished run.
    config
        The constants of foreground and labels.
    folder
        Where to.
    frames : int64 (n,)
        Consecutive frames of the run, one or more.
    overwrite
        Whether the folder may hold something already.

    Raises
    ------
    SourceError
        Where no camera delivers pixels, or a stream cannot be read.
    OutputError
    """
    recording, cameras = run.recording, require_pixels(run.recording)
    people = _people(run.trajectory, frames)
    largest = int(run.trajectory["id"].max(initial=0))
    images = LabelImages(folder, [run.cameras[k] for k in cameras], largest, _palette(), overwrite)
    views = view_labels(recording.rig, config.labels)
    sights = make_foregrounds(recording, config, int(run.frames[0]), int(run.frames[-1]) + 1)
    count = 0
    for moment in _moments(run, frames, config.foreground.memory):
        for k in cameras:
            seen = moment.views[k]
            pixels = sights[k].pixels(seen)
            if moment.frame in people:
                images.write(run.cameras[k], moment.frame, _ids(views[k], people[moment.frame], pixels, seen))
                count += 1
    return count


def require_pixels(recording: Recording) -> list[int]:
    """The cameras that deliver pixels; SourceError where none does."""
    found = [k for k, source in enumerate(recording.sources) if source.source.kind != "boxes"]
    if not found:
        raise SourceError(recording.path, "camera, source", "boxes alone", "a camera that delivers pixels")
    return found


def _people(trajectory: Rows, frames: Ints) -> dict[int, Rows]:
    """The rows of each frame."""
    order = np.argsort(trajectory["frame"], kind="stable")
    ends = [np.searchsorted(trajectory["frame"], frames, side, sorter=order) for side in ("left", "right")]
    parts = zip(frames.tolist(), *(end.tolist() for end in ends), strict=True)
    return {frame: trajectory[order[first:stop]] for frame, first, stop in parts}


def _moments(run: Run, frames: Ints, memory: float) -> Iterator[FrameSet]:
    """The frames that are asked for, and before them as many as it takes a background to follow the light, seconds."""
    first = max(int(run.frames[0]), int(frames[0]) - round(memory * run.frame_rate))
    console = Console(stderr=True)
    with open_frames(run.recording, first, int(frames[-1]) + 1) as moments:
        yield from track(
            moments, "labelling", total=int(frames[-1]) + 1 - first, console=console, transient=True,
            disable=not console.is_terminal,
        )  # fmt: skip


def _ids(view: ViewLabels, people: Rows, pixels: Singles | None, seen: Observation) -> Ints:
    """Ids of the tracks that a view shows, int64 (v, u); a view that is blind shows nobody."""
    if pixels is None:
        return np.zeros(view.camera.size[::-1], np.int64)
    covariance = np.stack([people[name] for name in ("xx", "xy", "xy", "yy")], -1).reshape(-1, 2, 2)
    ground, height = np.stack([people["x"], people["y"]], -1), people["height"].astype(float)
    image = np.asarray(seen, np.uint8) if isinstance(seen, np.ndarray) and seen.ndim == 3 else None
    index = view.label(PlacedPeople(ground, covariance, height), pixels, image)
    return np.asarray(np.append(0, people["id"])[index], np.int64)


def _palette() -> Bytes:
    """Colours of the ids, uint8 (256, 3), red, green, blue; nobody is black."""
    return np.array([(0, 0, 0), *(track_colour(identity)[::-1] for identity in range(1, 256))], np.uint8)
