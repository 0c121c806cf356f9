"""`stseg calibrate page`: a page on which ground points are clicked."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from shlex import quote
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from stseg.arrays import Bytes
from stseg.commands.calibrate.scene import area_of
from stseg.commands.options import Overwrite
from stseg.commands.terminal.counts import counted
from stseg.errors import ConfigError, SourceError
from stseg.io.outputs.whole_files import Inputs, require_output, write_file
from stseg.io.recording.pictures import read_colour
from stseg.io.recording.recording import Source
from stseg.io.recording.source_files import is_image_source
from stseg.io.recording.streams import open_stream
from stseg.io.recording.video.ffmpeg import read_frame_rate
from stseg.reporting.page.calibration_page import FloorPlan, calibration_page
from stseg.tasks.calibration.automatic import camera_names, uncalibrated_camera

_DEFAULT_FRAMES = (0, 50, 100, 200, 400, 800)
"""Frames that the slider chooses among where none is given: the later ones exist in long videos alone."""


def calibrate_page(
    *videos: Annotated[Path, Parameter(metavar="VIDEO...")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], metavar="POINTS.html")],
    area: Annotated[str, Parameter(metavar="X0,Y0,X1,Y1", allow_leading_hyphen=True)] = "-5,-5,5,5",
    frame: Annotated[tuple[int, ...], Parameter(negative="")] = (),
    plan: Annotated[Path | None, Parameter(metavar="PLAN.png")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a page on which you click ground points: the cameras' homographies are solved as you click.

    Example: stseg calibrate page cam*.mp4 -o points.html --area=-3,-3,3,3

    Open it in a browser; it works without a network. Click places of the ground in the views and on the plan, save
    points.csv, and give it to stseg calibrate points. **The page holds a frame of each camera.**

    Parameters
    ----------
    videos
        One video or picture a camera; file names, or those of their folders, become camera names.
    output
        The page.
    area
        Ground rectangle of the plan, metres.
    frame
        A frame of the videos that is shown; may be given several times, and a slider chooses among them. Without it,
        frames 0, 50, 100, 200, 400 and 800 of videos that are so long.
    plan
        Picture of the ground from above that spans the area exactly, y up.
    """
    require_output(output, overwrite, Inputs(videos, [plan]))
    names = camera_names(videos)
    if not videos or len(set(names)) < len(names):
        raise ConfigError("calibrate page", "VIDEO", ", ".join(map(str, videos)), "one or more, with different names")
    x0, y0, x1, y1 = area_of(area)
    frames = [_frames(path, frame) for path in videos]
    command = _next_command(videos, [one[0] for one in frames], area)
    floor = _plan(plan, x1 - x0, y1 - y0)
    page = calibration_page(names, frames, (x0, y0, x1, y1), floor, command)
    write_file(output, page.encode(), overwrite)
    print(f"wrote {output}: {counted(len(frames), 'view')} (it shows camera frames); open it in a browser")


def _frames(path: Path, chosen: tuple[int, ...]) -> list[Bytes]:
    """Colour frames of a video, or a picture."""
    if is_image_source(path):
        return [read_colour(path)]
    found: list[Bytes] = []
    stream, place = open_stream(Source("video", path), uncalibrated_camera(path.stem, path)), 0
    with closing(stream):
        for number in sorted(set(chosen or _DEFAULT_FRAMES)):
            view = stream.read() if stream.skip(number - place) == number - place else None
            place = number + 1
            if isinstance(view, np.ndarray):
                found.append(np.asarray(view, np.uint8))
            elif chosen or not found:
                raise SourceError(path, "--frame", number, "a frame of the video")
            else:
                break
    return found


def _next_command(videos: Sequence[Path], frames: Sequence[Bytes], area: str) -> str:
    """The command that makes a rig of the points; in words where views differ in size, as it takes one."""
    sizes = {(frame.shape[1], frame.shape[0]) for frame in frames}
    if len(sizes) > 1:
        return "the views differ in size: stseg calibrate points takes points of one size at a time (--size)"
    ((width, height),) = sizes
    films = [path for path in videos if not is_image_source(path)]
    rate = read_frame_rate(films[0]) if films else None
    frame_rate = "FRAMES_PER_SECOND" if rate is None else f"{rate:.6g}"
    scene = f"--size {width},{height} {quote(f'--area={area}')} --frame-rate {frame_rate}"
    streams = f"--sources {quote(','.join(map(str, videos)))}{'' if films else ' --source-kind images'}"
    return f"stseg calibrate points points.csv -o rig.toml {scene} {streams}"


def _plan(path: Path | None, width: float, height: float) -> FloorPlan | None:
    if path is None:
        return None
    image = read_colour(path)
    scale, other = image.shape[1] / width, image.shape[0] / height
    if abs(scale / other - 1) > 0.02:
        found = f"a picture {image.shape[1]} x {image.shape[0]} for {width:g} x {height:g} m"
        raise ConfigError("--plan", str(path), found, "a picture that spans --area, with square pixels")
    return FloorPlan(image, scale)
