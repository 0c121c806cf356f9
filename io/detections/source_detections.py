"""The detections of a camera's source: read in any known format, filtered, and counted from frame 0."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stseg.arrays import Flags, Floats, Singles
from stseg.errors import FormatError, SourceError
from stseg.io.detections.box_files import read_boxes, read_features
from stseg.io.detections.formats import read_detections
from stseg.io.detections.masks import Polygons
from stseg.io.detections.record import Detections, Request
from stseg.io.machine import return_freed_memory
from stseg.io.recording.recording import Recording, Source
from stseg.records.principal_axes import principal_axes
from stseg.records.tables import FEATURES

_BOXES_OF_AXES = 20_000
"""Most boxes of a camera from which axes are learned."""


@dataclass(frozen=True)
class SourceDetections:
    """Detections of one source."""

    format: str
    """The recognised format."""
    read: Detections
    """All detections, frames as the source counts them."""
    kept: Detections
    """Those of the wanted classes and scores, frames counted from 0."""
    frames: int
    """Number of frames."""

    @property
    def table(self) -> Detections:
        """The kept detections in the order of their frames."""
        frame, kept = self.kept.frame, self.kept
        if (frame[1:] < frame[:-1]).any():
            kept = kept.of(np.argsort(frame, kind="stable"))
        return replace(kept, frames=self.frames)


def read_source(source: Source, size: tuple[int, int]) -> SourceDetections:
    """Read a source of boxes, or of instances that are no images, for an image `size` (width, height), pixels.

    Its path may be any format of `stseg.io.detections.formats`. SourceError, FormatError where it cannot be read, or
    has no detections.
    """
    return _read(source, size, _stamp(source.path, *([source.appearance] if source.appearance else [])))


def _stamp(*paths: Path) -> tuple[int, int]:
    """Changes where one of the files does, so that nothing stale is kept."""
    try:
        found = [file.stat() for path in paths for file in (path.iterdir() if path.is_dir() else [path])]
    except OSError:
        return 0, 0
    return max((one.st_mtime_ns for one in found), default=0), sum(one.st_size for one in found)


@lru_cache(maxsize=64)
def _read(source: Source, size: tuple[int, int], _stamp_of_file: tuple[int, int]) -> SourceDetections:
    recognised = read_detections(Request(source, size))
    if recognised is None:
        if source.classes:
            raise SourceError(source.path, "classes", ", ".join(source.classes), "detections that have classes")
        boxes = read_boxes(source.path, source.first_frame, source.frames, source.appearance)
        found = replace(boxes, frame=boxes.frame + source.first_frame) if source.first_frame else boxes
        kept = boxes.of(boxes.score[:] >= source.least_score)
        return_freed_memory()  # of the text
        return SourceDetections("boxes as text", found, kept, boxes.frames or 0)
    name, found = recognised
    if source.appearance is not None:
        found = replace(found, features=read_features(source.appearance, len(found)))
    found = found.packed()
    return_freed_memory()  # of the file's objects
    kept = found.of(_wanted(found, source.classes, source.least_score))
    kept = replace(kept, frame=kept.frame - source.first_frame) if source.first_frame else kept
    return SourceDetections(name, found, kept, _length(source, found, kept))


def _wanted(found: Detections, classes: Sequence[str], least_score: float) -> Flags:
    wanted: Flags = np.asarray(found.score[:] >= least_score)
    if classes:
        lower = {name.lower() for name in classes}
        wanted &= np.array([label.lower() in lower for label in found.label] or [False] * len(found), bool)
    return wanted


def _length(source: Source, found: Detections, kept: Detections) -> int:
    """Number of frames: the rig's, the source's, or up to the last frame with a detection."""
    first, here = source.first_frame, "detections there"
    length = source.frames or (found.frames - first if found.frames is not None else None)
    if length is not None and length < 1:
        raise FormatError(source.path, "first_frame", str(first), f"a frame below {found.frames}")
    if length is None and not len(kept):
        classes = ", ".join(f"{name} ({count})" for name, count in found.classes().items())
        wanted = f"no detections of {', '.join(source.classes)}" if source.classes else "no detections"
        raise SourceError(source.path, "", f"{wanted}; classes are {classes or 'not given'}", "some detections")
    if (least := int(kept.frame.min(initial=0))) < 0:
        raise FormatError(source.path, f"frame {least + first}", here, f"a frame from first_frame = {first} on")
    if length is not None and (last := int(kept.frame.max(initial=-1))) >= length:
        raise FormatError(source.path, f"frame {last + first}", here, f"a frame below {length + first}")
    return int(found.frame.max()) - first + 1 if length is None else length


def instance_image(found: Detections, rows: Sequence[int], size: tuple[int, int]) -> NDArray[np.uint16]:
    """Masks of one frame as an instance image, the best score on top; detections without a mask are filled boxes."""
    image = np.zeros(size[::-1], np.uint16)
    for value, k in enumerate(sorted(rows, key=lambda row: float(found.score[row])), 1):
        mask = found.mask[k] if found.mask else None
        image[(mask or _box(found.pixel[k], size)).draw(size) > 0] = value
    return image


def _box(pixel: Floats, size: tuple[int, int]) -> Polygons:
    """The outline of a box, cut off beyond the image."""
    left, top, width, height = pixel.tolist()
    left, right = np.clip([left, left + width], -1, size[0])
    top, bottom = np.clip([top, top + height], -1, size[1])
    return Polygons((np.array([[left, top], [right, top], [right, bottom], [left, bottom]]),))


def appearance_axes(recording: Recording) -> Floats | None:
    """Principal axes of all cameras' features, float64 (feature, FEATURES or less); None where boxes have none.

    SourceError, FormatError where a file cannot be read, or cameras have features of different lengths.
    """
    samples = list[Singles]()
    for camera, feed in zip(recording.rig.cameras, recording.sources, strict=True):
        if feed.source.appearance is None:
            continue
        features = read_source(feed.source, camera.size).kept.features
        if features is None or not len(features):
            continue
        if samples and features.shape[1] != samples[0].shape[1]:
            found, expected = f"{features.shape[1]} numbers a box", f"{samples[0].shape[1]}, as of the cameras before"
            raise FormatError(feed.source.appearance, "", found, expected)
        step = -(-len(features) // _BOXES_OF_AXES)
        samples.append(np.asarray(features[::step]))
    return principal_axes(samples, FEATURES) if samples else None
