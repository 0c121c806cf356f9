"""A recording: the rig and the sources of its cameras' frames, as a rig file describes them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from stseg.arrays import Ints
from stseg.geometry import Camera, Rig
from stseg.geometry.rig import greatest_reduction

SourceKind = Literal["video", "masks", "images", "instances", "boxes"]
ClockSource = Literal["auto", "stamps", "count"]
SOURCE_KINDS: tuple[SourceKind, ...] = ("video", "masks", "images", "instances", "boxes")
HOG = Path("hog")
"""The detector that needs no file (`stseg.io.detectors.hog`)."""
_PASSWORD = re.compile(r"(://[^/\s:@\"]*):[^/\s\"]*@")


@dataclass(frozen=True, slots=True)
class Source:
    """One stream of frames: files, or the address of a live stream.

    Attributes
    ----------
    kind
        video: colour frames of a video file. images: colour frames, a folder or pattern. masks: likelihoods 0..255, a
        video, folder or pattern. instances: indexed images, one value an instance, 0 background, a folder or pattern.
        boxes: a detector's boxes, in any format of `stseg.io.detections.formats`; such files can be instances
        too, where they hold masks.
    path
        File, folder or pattern (`frame_*.png`, `hour_*.mp4`), already relative to the rig file's folder; of a live
        stream the last part of its address.
    more
        Further files, folders or patterns, each continuing the one before; not for boxes.
    starts
        Start of each file, seconds after the camera's frame 0; empty where each starts as the previous one ends.
    first_frame
        detections only: the number of the first frame in the file.
    frames
        detections only: number of frames; None where the last frame with a box is the last frame.
    address
        Of a live stream (rtsp://...); empty for files.
    classes
        detections only: names (or numbers) of the classes to keep; empty for all.
    least_score
        detections only: detections of lower score are left out.
    view
        detections only: number of the camera in files of several (WILDTRACK), from 0; None where it is not given.
    select
        detections only: pattern of image names in files of several cameras (COCO); empty for all.
    image_list
        detections only: file with the images of COCO results.
    columns
        detections only: pairs of our name and a CSV or Parquet file's name of a column.
    appearance
        detections only: .npy file of appearance features, a row for each detection in their order; None without.
    detector
        video and images only: a model in ONNX that finds people in them, or `HOG`; None for a run from pixels.
        `classes` and `least_score` are then those of the detector.
    features
        Beside a detector: a model in ONNX that makes appearance features of each box; None without.
    """

    kind: SourceKind
    path: Path
    first_frame: int = 0
    frames: int | None = None
    more: tuple[Path, ...] = ()
    starts: tuple[float, ...] = ()
    address: str = ""
    classes: tuple[str, ...] = ()
    least_score: float = 0.0
    view: int | None = None
    select: str = ""
    image_list: Path | None = None
    columns: tuple[tuple[str, str], ...] = ()
    appearance: Path | None = None
    detector: Path | None = None
    features: Path | None = None

    def without_detector(self) -> Source:
        """The frames alone."""
        return replace(self, detector=None, features=None, classes=(), least_score=0.0)


@dataclass(frozen=True, slots=True)
class CameraSource:
    """One camera's stream."""

    source: Source
    """Its frames."""
    background: Source | None = None
    """Source of the empty scene, or None."""
    offset: int = 0
    """Its frame k shows the scene at frame k + offset of the recording."""
    on_missing: Literal["error", "blind"] = "error"
    """Where its stream starts late or ends early: an error, or a blind view."""
    clock: ClockSource = "auto"
    """Source of frame times: the files' time stamps, frame counts, or automatic
    (`stseg.io.recording.time_alignment`)."""
    images: Source | None = None
    """Colour frames beside boxes, for pictures and colours; None where there are none."""
    frame_at_tick: Ints | None = field(default=None, compare=False, repr=False)
    """int64 (tick,): the camera's own frame shown at each tick, -1 where it is blind; None where frame k is shown at
    tick k, or before alignment."""

    @property
    def timed(self) -> Source:
        """The stream that has the time stamps: the images beside boxes where `clock` is "stamps", else the source."""
        if self.source.kind == "boxes" and self.clock == "stamps" and self.images is not None:
            return self.images
        return self.source


@dataclass(frozen=True, slots=True)
class BodyPrior:
    """Sizes of the bodies that a rig watches, metres; None where the rig does not say."""

    height_mean: float | None = None
    height_spread: float | None = None
    """Mean and standard deviation of heights."""
    width_mean: float | None = None
    width_spread: float | None = None
    """Mean and standard deviation of the widths across shoulders and arms."""


@dataclass(frozen=True)
class Recording:
    """A rig and its streams, one per camera in the rig's order."""

    path: Path
    rig: Rig
    sources: tuple[CameraSource, ...]
    body: BodyPrior = BodyPrior()
    reduction: tuple[int, ...] = field(default=(), kw_only=True)
    """Whole factors by which the cameras' colour frames are reduced as they are read; empty for frames as they are."""

    def __repr__(self) -> str:
        kinds = ", ".join(dict.fromkeys(stream.source.kind for stream in self.sources))
        return f"Recording({str(self.path)!r}: {kinds}, {self.rig!r})"

    @property
    def factors(self) -> tuple[int, ...]:
        """The reduction of every camera, 1 for none."""
        return self.reduction or (1,) * len(self.sources)

    @property
    def reduced_rig(self) -> Rig:
        """The rig of the frames as they are read."""
        return self.rig.reduced(self.reduction) if self.reduction else self.rig

    def reduced(self, rows: float) -> Recording:
        """The recording with colour frames reduced as far as standing people still span `rows` pixels."""
        cameras = zip(self.rig.cameras, self.sources, strict=True)
        return replace(self, reduction=tuple(self._factor(camera, feed, rows) for camera, feed in cameras))

    @property
    def has_camera_frames(self) -> bool:
        """Whether any source holds frames of a camera, in which people may be recognised."""
        return any(feed.source.kind in ("video", "images") for feed in self.sources)

    def pictured(self) -> Recording:
        """The recording with its cameras' colour frames in place of boxes, where `images` or a detector's video is."""
        sources = (
            replace(feed, source=(feed.images or feed.source).without_detector(), images=None)
            if feed.images is not None or feed.source.detector is not None
            else feed
            for feed in self.sources
        )
        return replace(self, sources=tuple(sources))

    def without_images(self) -> Recording:
        """The recording without the colour frames beside detections."""
        return replace(self, sources=tuple(replace(feed, images=None) for feed in self.sources))

    def _factor(self, camera: Camera, feed: CameraSource, rows: float) -> int:
        colour = feed.source.kind in ("video", "images")
        return greatest_reduction(camera, self.rig.grid, rows) if colour else 1


def mask_passwords(text: str) -> str:
    """A text with the passwords in addresses of live streams (`rtsp://name:password@...`) masked."""
    return _PASSWORD.sub(r"\1:***@", text)
