"""WILDTRACK and MultiviewX: a folder of JSON, one file a frame, each with the boxes of all views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stseg.errors import FormatError
from stseg.io.detections.frame_names import listed_frames
from stseg.io.detections.json_files import require
from stseg.io.detections.record import DetectionList, Detections, Request

_KEYS = ("xmin", "ymin", "xmax", "ymax")


def is_frame(data: Any) -> bool:
    """Whether parsed JSON is one frame of annotations."""
    return isinstance(data, list) and bool(data) and isinstance(data[0], dict) and {"personID", "views"} <= set(data[0])


def read_frames(request: Request, paths: list[Path], data: list[Any]) -> Detections:
    """Boxes of one view; -1 marks a person that the view does not show."""
    if request.view is None:
        raise FormatError(request.path, "view", "no number of the camera", "view = NUMBER in the rig's source, from 0")
    frames, count = listed_frames([path.name for path in paths])
    found, has_view = DetectionList(request.path), False
    for path, frame, people in zip(paths, frames.tolist(), data, strict=True):
        for index, person in enumerate(people):
            place = f"{path.name}, person {index}"
            for view in require(request.path, place, person, "views"):
                if require(request.path, place, view, "viewNum") != request.view:
                    continue
                has_view = True
                corners = [require(request.path, place, view, key) for key in _KEYS]
                if corners != [-1, -1, -1, -1]:
                    found.add_corners(place, frame, corners, label="person")
    if not has_view:
        raise FormatError(
            request.path, f"view {request.view}", "no such viewNum", "the camera's number in the files: view"
        )
    return found.done(count)
