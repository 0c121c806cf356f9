"""What a rig file describes: the rig, and where the frames of each camera come from."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from stseg.geometry import Rig

SourceKind = Literal["video", "masks", "images", "instances", "boxes"]
SOURCE_KINDS: tuple[SourceKind, ...] = ("video", "masks", "images", "instances", "boxes")
_PASSWORD = re.compile(r"(://[^/\s:@\"]*):[^/\s\"]*@")


@dataclass(frozen=True, slots=True)
class Source:
    """One stream of frames on disk, or a live one.

    Attributes
    ----------
    kind
        video: colour frames of a video file. images: colour frames, a folder or pattern. masks: likelihoods 0..255, a
        video, folder or pattern. instances: indexed images, one value an instance, 0 background, a folder or pattern.
        boxes: a text file of a detector's boxes.
    path
        File, folder or pattern (`frame_*.png`, `hour_*.mp4`), already relative to the rig file's folder; of a live
        stream the last part of its address.
    more
        Not for boxes: files, folders or patterns that go on where the one before ends.
    first_frame
        boxes only: the number that the file gives to its first frame.
    frames
        boxes only: how many frames there are, where the file's last line does not say it; None to take the last line.
    """

    kind: SourceKind
    path: Path
    first_frame: int = 0
    frames: int | None = None
    more: tuple[Path, ...] = ()
    address: str = ""


@dataclass(frozen=True, slots=True)
class CameraSource:
    """One camera's stream.

    Attributes
    ----------
    source
        Its frames.
    background
        The empty scene to learn from, or None.
    offset
        Its frame k shows the scene at frame k + offset of the recording.
    on_missing
        What to do where its stream ends early: an error, or a view that sees nothing from there on.
    """

    source: Source
    background: Source | None = None
    offset: int = 0
    on_missing: Literal["error", "blind"] = "error"


@dataclass(frozen=True)
class Recording:
    """A rig and its streams, one per camera in the rig's order."""

    path: Path
    rig: Rig
    sources: tuple[CameraSource, ...]


def without_passwords(text: str) -> str:
    """A text in which the addresses of live streams (`rtsp://name:password@...`) show no password."""
    return _PASSWORD.sub(r"\1:***@", text)
