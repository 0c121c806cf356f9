"""MMDetection: JSON of `DetInferencer`, one file an image (its folder `preds`), or a list of them."""

from __future__ import annotations

from typing import Any

from stseg.errors import FormatError
from stseg.io.detections.json_files import require
from stseg.io.detections.masks import run_lengths
from stseg.io.detections.record import DetectionList, Detections, Request


def is_prediction(data: Any) -> bool:
    """Whether parsed JSON is the prediction of one image."""
    return isinstance(data, dict) and {"labels", "scores", "bboxes"} <= set(data)


def is_list(data: Any) -> bool:
    """Whether parsed JSON is a list of predictions, or the inferencer's dictionary around it."""
    rows = data.get("predictions") if isinstance(data, dict) else data
    return isinstance(rows, list) and bool(rows) and all(map(is_prediction, rows))


def read_list(request: Request, data: Any) -> Detections:
    """Detections of a list of predictions, one a frame."""
    rows = data["predictions"] if isinstance(data, dict) else data
    found = DetectionList(request.path)
    for frame, row in enumerate(rows):
        _add(request, found, f"frame {frame}", frame, row)
    return found.done(len(rows))


def _add(request: Request, found: DetectionList, place: str, frame: int, row: Any) -> None:
    boxes, scores, labels = (require(request.path, place, row, key) for key in ("bboxes", "scores", "labels"))
    masks = row.get("masks") or [None] * len(boxes)
    if not len(boxes) == len(scores) == len(labels) == len(masks):
        raise FormatError(request.path, place, "bboxes, scores, labels and masks of different lengths", "one each")
    for corners, score, label, mask in zip(boxes, scores, labels, masks, strict=True):
        try:
            drawn = None if mask is None else run_lengths(mask["size"], mask["counts"])
        except (ValueError, TypeError, KeyError) as error:
            raise FormatError(request.path, place, f"a mask: {error}"[:100], "run lengths as COCO's") from error
        found.add_corners(place, frame, corners, score, str(label), drawn)
