"""The sources of a rig file: what they were recognised as, what they deliver, and pictures of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.arrays import Bytes, Flags, Floats, Ints, Observation, even_rows
from stseg.calibration.check.blunders import find_swapped_streams
from stseg.calibration.check.box_correspondence import isolated_boxes
from stseg.calibration.check.rig_check import swapped_text
from stseg.config import BodyConfig
from stseg.geometry import Camera, Grid, Rig
from stseg.io.detections.source_detections import SourceDetections, read_source
from stseg.io.outputs.whole_files import Inputs, make_folder, write_png
from stseg.io.recording.aligned_stream import require_own_sources
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import CameraSource, Recording
from stseg.io.recording.source_files import is_detection_file, recording_files
from stseg.reporting.figures import backdrop
from stseg.reporting.page.html import png_bytes
from stseg.reporting.pictures.canvas import outline
from stseg.reporting.pictures.overlay import grid_picture
from stseg.view_health.agreement import agreement_warnings
from stseg.view_health.plausibility import box_warnings, pace_warnings, scene_warnings, twin_warnings

COLUMNS = ("camera", "recognised", "frames", "boxes", "a frame", "height px", "score", "feet in area", "classes")
"""Headings of `SourceSummary.row`."""
_PICTURE_WIDTH = 1280
"""Pixels."""
_BOX_COLOUR = (80, 220, 120)
_OUTSIDE_SHARE = 0.5
"""Share of feet outside the area from which there is a warning."""
_BEYOND_SHARE = 0.05
"""The same of boxes that begin beyond the right or lower edge of the image."""
_COMPARED_FRAMES = 200
"""Frames, from all the recording, by which swapped cameras are found."""
_BOXES_AT_ONCE = 1 << 15
"""Boxes that are projected at a time: a day has millions."""
_FOOT, _FOOT_OF_CENTRE = (0.5, 1.0), (0.0, 0.5)
"""From left and top to the middle of the lower edge, in widths and heights; the same if they are a box's centre."""


@dataclass(frozen=True)
class SourceSummary:
    """One camera's source."""

    camera: Camera
    source: CameraSource
    grid: Grid
    detections: SourceDetections | None
    """Those of the source; None where it delivers pixels."""
    height: float
    """Mean height of a body, metres."""

    def ground(self, foot: tuple[float, float] = _FOOT) -> tuple[Floats, Flags]:
        """Where each foot projects, float64 (n, 2), metres; whether that is in the ground rectangle, bool (n,)."""
        grid, boxes = self.grid, self.boxes
        parts = (boxes[k : k + _BOXES_AT_ONCE] for k in range(0, len(boxes) or 1, _BOXES_AT_ONCE))
        ground = np.concatenate([self.camera.back_project(part[:, :2] + part[:, 2:] * foot) for part in parts])
        with np.errstate(invalid="ignore"):
            inside = (ground > [grid.x[0], grid.y[0]]) & (ground < [grid.x[1], grid.y[1]])
        return ground, np.asarray(inside.all(axis=1))

    def feet(self, foot: tuple[float, float] = _FOOT) -> tuple[Ints, Floats]:
        """Frames of the recording (n,) and places (n, 2), metres, of the boxes that stand in the area."""
        ground, within = self.ground(foot)
        frame = np.zeros(0, np.int64) if self.detections is None else self.detections.kept.frame[within]
        return frame + self.source.offset, ground[within]

    @property
    def boxes(self) -> Floats:
        """Left, top, width and height of all boxes, pixels, float64 (n, 4); none of a source of pixels."""
        return np.zeros((0, 4)) if self.detections is None else self.detections.kept.pixel[:]

    def boxes_at(self, frame: int) -> Floats:
        """Edges of the boxes in a frame of the recording, float64 (n, 4), see `isolated_boxes`."""
        boxes = None if self.detections is None else self.detections.kept.at(frame - self.source.offset)
        return isolated_boxes(boxes, self.camera.size)

    def row(self) -> tuple[str, ...]:
        """Format and contents in words, under `COLUMNS`."""
        found, pixel = self.detections, self.boxes
        if found is None:
            return self.camera.name, self.source.source.kind, *[""] * (len(COLUMNS) - 2)
        return (
            self.camera.name,
            found.format + (" with masks" if found.read.mask else ""),
            str(found.frames),
            str(len(pixel)),
            f"{len(pixel) / max(found.frames, 1):.1f}",
            _span(pixel[:, 3], "{:.0f}"),
            _span(found.kept.score[:], "{:.2f}"),
            f"{100 * self.ground()[1].mean():.0f} %" if len(pixel) else "",
            ", ".join(f"{name} {count}" for name, count in list(found.read.classes().items())[:5]),
        )

    def warnings(self) -> Iterator[str]:
        """One sentence for each number that is probably a mistake of the rig file."""
        name, found, pixel = self.camera.name, self.detections, self.boxes
        if found is None or not len(pixel):
            return
        outside = 1 - float(self.ground()[1].mean())
        if outside > _OUTSIDE_SHARE:
            yield (
                f"{name}: {100 * outside:.0f} % of its feet project outside the area: "
                "is it this camera, and the image size right? Where people walk there, a larger area keeps them apart "
                "from those inside"
            )
        if not found.kept.score[:].any():
            yield f"{name}: all scores of its boxes are 0, and they count little: an unknown score is -1"
        excess = float((pixel[:, :2] > self.camera.size).any(axis=1).mean())
        if excess > _BEYOND_SHARE:
            yield f"{name}: {100 * excess:.0f} % of its boxes begin beyond the image: is the image size right?"
        yield from box_warnings(self.camera, self.grid, pixel, self.height)

    def picture(self, view: Observation, frame: int) -> Bytes:
        """The ground's grid and the boxes of a frame, on the camera's image where there is one."""
        colourless = view is None or (self.detections is not None and self.source.images is None)
        image = None if colourless else backdrop(view, self.camera.size)
        picture = grid_picture(self.camera, self.grid, image, frame, _PICTURE_WIDTH)
        if self.detections is not None:
            scale = picture.shape[1] / self.camera.size[0]
            boxes = self.boxes[self.detections.kept.frame == frame - self.source.offset]
            for left, top, width, height in (boxes * scale).tolist():
                right, bottom = left + width, top + height
                corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
                outline(picture, corners, _BOX_COLOUR, 2)
        return picture


def summarise_sources(recording: Recording) -> list[SourceSummary]:
    """A summary of each camera's source; raises InputError where one cannot be read."""
    require_own_sources(recording)
    cameras, height = zip(recording.rig.cameras, recording.sources, strict=True), body_height(recording)
    return [SourceSummary(camera, one, recording.rig.grid, _detections(one, camera), height) for camera, one in cameras]


def body_height(recording: Recording) -> float:
    """Mean height of the bodies that a rig watches, metres."""
    return recording.body.height_mean or BodyConfig.height_mean


def recording_warnings(recording: Recording, summaries: Sequence[SourceSummary]) -> list[str]:
    """One sentence for each number of a rig or its boxes that is probably a mistake."""
    names, rig = [camera.name for camera in recording.rig.cameras], recording.rig
    feet = [one.feet() for one in summaries]
    if swapped := _swapped(rig, summaries, np.unique(np.concatenate([frame for frame, _ in feet]))):
        return swapped
    paces = (words for one in feet for words in pace_warnings(rig.frame_rate, *one, body_height(recording)))
    return [
        *scene_warnings(rig, body_height(recording)),
        *_first_frame_warnings(summaries),
        *(words for summary in summaries for words in summary.warnings()),
        *twin_warnings(names, [summary.boxes for summary in summaries]),
        *list(paces)[:1],
        *agreement_warnings(rig.cameras, feet, lambda: [one.feet(_FOOT_OF_CENTRE) for one in summaries]),
    ]


def _first_frame_warnings(summaries: Sequence[SourceSummary]) -> Iterator[str]:
    """One sentence where no camera has detections in frame 0, but one in frame 1, and no source gives `first_frame`."""
    detections = (one.detections for one in summaries if one.detections is not None and len(one.boxes))
    first = min((int(one.read.frame.min()) for one in detections), default=0)
    if first == 1 and not any(one.source.source.first_frame for one in summaries):
        yield "no camera has detections in frame 0, but in frame 1: do frames count from 1? (first_frame = 1)"


def _swapped(rig: Rig, summaries: Sequence[SourceSummary], frames: Ints) -> list[str]:
    """A warning of two cameras whose boxes in some of these frames fit far better with their sources swapped."""
    frames = frames[even_rows(len(frames), _COMPARED_FRAMES)]
    boxes = {frame: [one.boxes_at(frame) for one in summaries] for frame in frames.tolist()}
    found = find_swapped_streams(rig, boxes) if boxes else ()
    return [swapped_text(rig, found)] if found else []


def write_source_pictures(recording: Recording, summaries: list[SourceSummary], folder: Path, overwrite: bool) -> bool:
    """Write a picture of each camera amid what the cameras deliver; whether they show camera frames."""
    make_folder(folder)
    inputs = Inputs(recording_files(recording))
    counts = [one.detections.frames for one in summaries if one.detections is not None]
    frame, pictured = min(counts) // 2 if counts else 0, recording.pictured()
    with open_frames(pictured, frame, frame + 1) as frame_sets:
        views = next((frame_set.views for frame_set in frame_sets), (None,) * len(summaries))
    for summary, view in zip(summaries, views, strict=True):
        picture = png_bytes(summary.picture(view, frame))
        write_png(folder / f"{summary.camera.name}.png", picture, overwrite, inputs)
    return pictured.has_camera_frames


def _detections(stream: CameraSource, camera: Camera) -> SourceDetections | None:
    source = stream.source
    if source.kind == "boxes" or (source.kind == "instances" and is_detection_file(source.path)):
        return read_source(source, camera.size)
    return None


def _span(values: Floats, form: str) -> str:
    """The 5th to the 95th percentile."""
    if not len(values):
        return ""
    low, high = map(form.format, np.percentile(values, (5, 95)))
    return low if low == high else f"{low}-{high}"
