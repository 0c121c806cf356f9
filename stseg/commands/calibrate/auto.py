"""`stseg calibrate auto`: a rig from the videos themselves."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import Progress, TaskID

from stseg.arrays import Bytes, Floats
from stseg.calibration.adjusted_rig import (
    cameras_of,
    distance_factor,
    grid_of,
    offsets_of,
    reports_of,
    scaled,
)
from stseg.calibration.automatic.auto import calibrate_from_people, sharpen_by_floor, steps_of
from stseg.calibration.automatic.endpoints import Endpoints, concatenate_endpoints, upright_endpoints
from stseg.calibration.automatic.solution import CalibrationInput, Solution
from stseg.commands.calibrate.scene import numbers
from stseg.config import Config
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.engine.offline.frame_range import FrameRange
from stseg.errors import ConfigError
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Camera, Grid, Rig
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rigs import write_rig
from stseg.io.recording.stream_index import StreamIndex, index_streams
from stseg.io.recording.video.video_size import read_video_size

_MOST_FRAMES = 3000


def calibrate_auto(
    *videos: Annotated[Path, Parameter(metavar="VIDEO...")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="RIG.toml")],
    frame_rate: float,
    person_height: float = 1.7,
    distance: Annotated[str | None, Parameter(metavar="CAMERA,U,V,U,V,METRES")] = None,
    most_delay: float = 2.0,
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    background: Annotated[str | None, Parameter(metavar="PATTERN")] = None,
    source_kind: Literal["video", "masks"] = "video",
    cell: float = Grid.cell,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Make a rig file from the videos alone: from people who walk where several cameras see them.

    Each camera learns its background and finds isolated people. Their feet and heads give its lens, tilt and height;
    their paths give the cameras' positions and delays; a bundle adjustment refines everything, with floor features that
    views share, where there are any. One or two people who walk all over the ground for a minute are best.

    ```
    stseg calibrate auto cam*.avi -o room.toml --frame-rate 25 --distance cam1,120,340,410,335,2.5
    ```

    Parameters
    ----------
    videos
        One video a camera; file names become camera names.
    output
        The rig file to write.
    frame_rate
        Frames per second of all videos.
    person_height
        Mean body height, metres. It sets the scale where no distance is given.
    distance
        Two ground pixels of one camera and their distance in metres; it sets the scale.
    most_delay
        Greatest delay of one video against another, seconds; 0 where all are synchronous.
    frames
        Part of the videos, half open; without it the first 3000 frames.
    background
        Video of every camera's empty scene, `{name}` standing for the camera's name.
    source_kind
        Colour videos, or videos of masks.
    cell
        Side of a ground cell of the rig, metres.
    overwrite
        Replace the rig file if it exists.
    """
    require_new(output, overwrite)
    streams = _streams(videos, output, frame_rate, background, source_kind)
    names = [camera.name for camera in streams.rig.cameras]
    known = None if distance is None else _distance(distance, names)
    counted = index_streams(streams)
    for note in counted.notes:
        print(f"stseg: {note}", file=sys.stderr)
    first, stop = _frames(frames, counted.length)
    foregrounds = make_foregrounds(streams, Config(), first, stop, streams=counted)
    views = CalibrationInput(
        _ends(streams, counted, foregrounds, first, stop),
        tuple(camera.size for camera in streams.rig.cameras),
        frame_rate,
        person_height,
        most_delay,
    )
    with _bar("calibrating", steps_of(len(names))) as (bar, task):
        solution = calibrate_from_people([str(path) for path in videos], views, lambda: bar.advance(task))
    backgrounds = _backgrounds(foregrounds)
    marks = 0
    if backgrounds:
        solution, marks = sharpen_by_floor(views, solution, backgrounds)
    if known is not None:
        view, pixels, metres = known
        solution = scaled(solution, _factor(distance_factor(solution, view, pixels, metres)))
    recording = _recording(output, streams, solution, cell)
    write_rig(output, recording)
    _print(recording, solution, person_height if known is None else None)
    print(
        f"{output}: {len(names)} cameras, from {len(solution.adjustment.parameters.points)} people and frames"
        + (f" and {marks} marks on the floor" if marks else ", the floor shows no marks that views share")
    )


def _streams(
    videos: Sequence[Path], output: Path, frame_rate: float, background: str | None, kind: Literal["video", "masks"]
) -> Recording:
    """The videos as a recording with placeholder cameras; streams may end at different times."""
    names = [path.stem for path in videos]
    if len(set(names)) < len(names):
        names = [path.absolute().parent.name for path in videos]
    if len(videos) < 2 or len(set(names)) < len(names):
        raise ConfigError("calibrate auto", "VIDEO", ", ".join(map(str, videos)), "two or more, with different names")
    if not frame_rate > 0:
        raise ConfigError("--frame-rate", "", frame_rate, "frames per second, above 0")
    unknown = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 1.0]])
    cameras = tuple(
        Camera.from_projection(name, read_video_size(path), unknown) for name, path in zip(names, videos, strict=True)
    )
    sources = tuple(
        CameraSource(
            Source(kind, path),
            None if background is None else Source("video", Path(background.replace("{name}", name))),
            on_missing="blind",
        )
        for name, path in zip(names, videos, strict=True)
    )
    return Recording(output, Rig(output.stem, frame_rate, Grid((0.0, 1.0), (0.0, 1.0)), cameras), sources)


def _ends(
    streams: Recording, counted: StreamIndex, foregrounds: Sequence[ViewForeground], first: int, stop: int
) -> tuple[Endpoints, ...]:
    """Feet and heads of isolated people, frame by frame and view by view."""
    found: list[list[tuple[int, Floats]]] = [[] for _ in foregrounds]
    with (
        open_frames(streams, first, stop, counted) as frame_sets,
        _bar("looking for people", stop - first) as (bar, task),
    ):
        for frame_set in frame_sets:
            for foreground, view, endpoints in zip(foregrounds, frame_set.views, found, strict=True):
                likelihood = foreground.evidence(view)
                if isinstance(likelihood, np.ndarray):
                    endpoints.append((frame_set.frame, upright_endpoints(likelihood)))
            bar.advance(task)
    return tuple(concatenate_endpoints(parts) for parts in found)


def _backgrounds(foregrounds: Sequence[ViewForeground]) -> list[Bytes]:
    """The empty scene in each view; none where the streams are masks."""
    return [
        np.clip(np.rint(foreground.background.model.background_image()), 0, 255).astype(np.uint8)
        for foreground in foregrounds
        if foreground.background is not None
    ]


def _recording(output: Path, streams: Recording, solution: Solution, cell: float) -> Recording:
    names = [camera.name for camera in streams.rig.cameras]
    rig = replace(streams.rig, grid=grid_of(solution, cell), cameras=cameras_of(solution, names))
    offsets = offsets_of(solution)
    # Streams that began at different times end at different times too.
    missing: Literal["blind", "error"] = "blind" if offsets.any() else "error"
    sources = tuple(
        replace(source, offset=int(offset), on_missing=missing)
        for source, offset in zip(streams.sources, offsets, strict=True)
    )
    return Recording(output, rig, sources)


def _print(recording: Recording, solution: Solution, person_height: float | None) -> None:
    cameras = zip(recording.rig.cameras, recording.sources, reports_of(solution), strict=True)
    for camera, source, report in cameras:
        x, y, z = camera.centre
        print(
            f"{camera.name}: at ({x:.2f}, {y:.2f}, {z:.2f}) m ± {report.centre_spread:.2f}, "
            f"focal length {report.focal:.0f} ± {report.focal_spread:.0f} px, "
            f"offset {source.offset} and {report.clock:+.3f} ± {report.clock_spread:.3f} s; "
            f"{report.observations} sightings: feet {report.foot_pixels:.1f} px ({100 * report.ground_metres:.0f} cm), "
            f"heads {report.head_pixels:.1f} px ({100 * report.head_metres:.0f} cm) off"
        )
    points = solution.adjustment.parameters.points
    if person_height is None:
        print(f"scale: by the distance given; people are {np.median(points[:, 2]):.2f} m tall on the average")
    else:
        print(f"scale: people are taken to be {person_height:g} m tall on the average (--person-height, --distance)")


def _distance(text: str, names: Sequence[str]) -> tuple[int, Floats, float]:
    camera, _, rest = text.partition(",")
    expected = f"camera,u,v,u,v,metres with a camera of {', '.join(names)}"
    if camera not in names:
        raise ConfigError("--distance", "", repr(text), expected)
    *pixels, metres = numbers("--distance", rest, expected, 5)
    if not metres > 0 or pixels[:2] == pixels[2:]:
        raise ConfigError("--distance", "", repr(text), "two different pixels, and metres above 0")
    return list(names).index(camera), np.array(pixels).reshape(2, 2), metres


def _factor(factor: float) -> float:
    if not np.isfinite(factor):
        raise ConfigError("--distance", "", "a pixel above the horizon", "pixels that show the ground")
    return factor


def _frames(text: str | None, length: int) -> tuple[int, int]:
    given = FrameRange.parse(text or f"0:{min(length, _MOST_FRAMES)}")
    first, stop = given.first or 0, length if given.stop is None else min(given.stop, length)
    if not first < stop:
        raise ConfigError("--frames", "", repr(text), f"a part of the videos' frames, 0:{length}")
    return first, stop


@contextmanager
def _bar(title: str, total: int) -> Iterator[tuple[Progress, TaskID]]:
    """A bar on a terminal; silence in a log."""
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        yield bar, bar.add_task(title, total=total)
