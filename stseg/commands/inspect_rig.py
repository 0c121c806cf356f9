"""`stseg inspect RIG.toml`: what the sources of a rig file deliver."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from stseg.arrays import Bytes, Floats, Observation
from stseg.geometry import Camera, Grid
from stseg.io.detections.source_detections import SourceDetections, read_source
from stseg.io.outputs.output_files import make_folder, write_file
from stseg.io.recording.frames import open_frames
from stseg.io.recording.image_stream import is_detection_file
from stseg.io.recording.recording import CameraSource, Recording
from stseg.io.recording.rigs import read_recording
from stseg.reporting.figures import backdrop
from stseg.reporting.page.html import png_bytes
from stseg.reporting.pictures.canvas import outline
from stseg.reporting.pictures.ground_grid import grid_picture

_NAMES = ("camera", "recognised", "frames", "boxes", "a frame", "height px", "score", "feet in area", "classes")
_WIDTH = 1280
_BOX = (80, 220, 120)
_FAR = 0.5
"""Share of feet outside the area from which there is a warning."""


def inspect_rig(path: Path, pictures: Path | None, overwrite: bool) -> None:
    """Print what each camera's source is and holds, and draw one frame of each camera into a folder.

    Raises
    ------
    InputError
        Where the rig file or a source cannot be read.
    """
    recording = read_recording(path)
    found = [_detections(own, camera) for own, camera in zip(recording.sources, recording.rig.cameras, strict=True)]
    console = Console(highlight=False, markup=False)
    table = Table(box=None, padding=(0, 2, 0, 0), title=str(path), title_justify="left")
    for name in _NAMES:
        table.add_column(name, justify="left" if name in ("camera", "recognised", "classes") else "right")
    for own, camera, one in zip(recording.sources, recording.rig.cameras, found, strict=True):
        table.add_row(camera.name, *_row(own, camera, recording.rig.grid, one))
    console.print(table)
    for camera, one in zip(recording.rig.cameras, found, strict=True):
        for words in _warnings(camera, recording.rig.grid, one):
            console.print(f"warning: {words}", style="yellow", soft_wrap=True)
    if pictures is not None:
        make_folder(pictures)
        for name, picture in _pictures(recording, found):
            write_file(pictures / f"{name}.png", png_bytes(picture), overwrite)
        shown = "they show camera frames" if _shows_frames(recording) else "boxes on the ruled ground"
        print(f"wrote {len(recording.sources)} pictures to {pictures} ({shown})")


def _shows_frames(recording: Recording) -> bool:
    return any(own.source.kind in ("video", "images") for own in recording.pictured().sources)


def _detections(own: CameraSource, camera: Camera) -> SourceDetections | None:
    """The detections of a source, None where it delivers pixels."""
    if own.source.kind == "boxes" or (own.source.kind == "instances" and is_detection_file(own.source.path)):
        return read_source(own.source, camera.size)
    return None


def _row(own: CameraSource, camera: Camera, grid: Grid, one: SourceDetections | None) -> tuple[str, ...]:
    if one is None:
        return own.source.kind, *[""] * (len(_NAMES) - 2)
    pixel, score = one.kept.pixel, one.kept.score
    classes = ", ".join(f"{name} {count}" for name, count in list(one.read.classes().items())[:5])
    return (
        one.format + (" with masks" if one.read.mask else ""),
        str(one.frames),
        str(len(one.kept)),
        f"{len(one.kept) / max(one.frames, 1):.1f}",
        _span(pixel[:, 3], "{:.0f}"),
        _span(score, "{:.2f}"),
        f"{100 * _in_area(camera, grid, pixel).mean():.0f} %" if len(pixel) else "",
        classes,
    )


def _span(values: Floats, form: str) -> str:
    """The 5th to the 95th percentile."""
    if not len(values):
        return ""
    low, high = np.percentile(values, (5, 95))
    return f"{form.format(low)}-{form.format(high)}"


def _in_area(camera: Camera, grid: Grid, pixel: Floats) -> Floats:
    """1 where the middle of a box's lower edge projects into the ground rectangle, else 0, float64 (n,)."""
    foot = camera.back_project(np.stack([pixel[:, 0] + pixel[:, 2] / 2, pixel[:, 1] + pixel[:, 3]], -1))
    with np.errstate(invalid="ignore"):
        inside = (foot > [grid.x[0], grid.y[0]]) & (foot < [grid.x[1], grid.y[1]])
    return inside.all(axis=1).astype(float)


def _warnings(camera: Camera, grid: Grid, one: SourceDetections | None) -> Iterator[str]:
    if one is None or not len(one.kept):
        return
    first = int(one.kept.frame.min())
    if first == 1 and int(one.read.frame.min()) == 1:
        yield f"{camera.name}: its first frame with detections is 1: do its frames count from 1? (first_frame = 1)"
    outside = 1 - float(_in_area(camera, grid, one.kept.pixel).mean())
    if outside > _FAR:
        yield (
            f"{camera.name}: {100 * outside:.0f} % of its feet project outside the area: "
            "is it this camera, and the image size right?"
        )
    right = float((one.kept.pixel[:, 0] + one.kept.pixel[:, 2]).max())
    if right > 1.2 * camera.size[0]:
        yield f"{camera.name}: boxes reach to column {right:.0f} of an image {camera.size[0]} pixels wide"


def _pictures(recording: Recording, found: list[SourceDetections | None]) -> Iterator[tuple[str, Bytes]]:
    """A frame in the middle of what the cameras deliver, with the ground's grid and the boxes."""
    counts = [one.frames for one in found if one is not None]
    frame = min(counts) // 2 if counts else 0
    views = _views(recording.pictured(), frame)
    for camera, own, one, view in zip(recording.rig.cameras, recording.sources, found, views, strict=True):
        image = None if view is None or (one is not None and own.images is None) else backdrop(view, camera.size)
        picture = grid_picture(camera, recording.rig.grid, image, frame, _WIDTH)
        if one is not None:
            _draw_boxes(picture, one.kept.pixel[one.kept.frame == frame - own.offset], camera)
        yield camera.name, picture


def _views(recording: Recording, frame: int) -> tuple[Observation, ...]:
    with open_frames(recording, frame, frame + 1) as frame_sets:
        for frame_set in frame_sets:
            return frame_set.views
    return (None,) * len(recording.sources)


def _draw_boxes(picture: Bytes, pixel: Floats, camera: Camera) -> None:
    scale = picture.shape[1] / camera.size[0]
    for left, top, width, height in (pixel * scale).tolist():
        right, bottom = left + width, top + height
        outline(picture, np.array([[left, top], [right, top], [right, bottom], [left, bottom]]), _BOX, 2)
