"""Ultralytics (YOLO): folders of text files, one a frame, and the JSON of its results."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from stseg.errors import FormatError, SourceError
from stseg.io.detections.masks import Mask, flat_polygons, polygons
from stseg.io.detections.record import DetectionList, Detections, Request, last_numbers, number, required_value
from stseg.io.recording.source_files import CLASS_LISTS, class_lists
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_text, reading

_POSE = frozenset(5 + keypoints + after for keypoints in (34, 51) for after in (0, 1, 2))
"""Numbers in a line of a pose model: box, 17 keypoints of 2 or 3 numbers, and perhaps confidence and track id."""
_ENTRY = re.compile(r"^\s*(?:(\d{1,9})\s*:|-)\s*['\"]?([^'\"#]+?)['\"]?\s*(?:#.*)?$")


def text_files(folder: Path) -> list[Path]:
    """The label files of a folder: text, but no list of class names."""
    return sorted(path for path in folder.glob("*.txt") if path.name not in CLASS_LISTS)


def read_text_folder(request: Request) -> Detections:
    """Lines of class, centre, width and height as shares of the image, and perhaps confidence and track id.

    Lines with more numbers are outlines (segmentation), of which masks are made.
    """
    paths = text_files(request.path)
    frames = last_numbers([path.name for path in paths])
    if frames is None:
        found = f"{len(paths)} text files whose names do not number their frames"
        raise SourceError(request.path, "", found, "one file a frame, such as video_12.txt")
    lines = [
        (path, row, frame, line.split())
        for path, frame in zip(paths, frames.tolist(), strict=True)
        for row, line in enumerate(_text(path).splitlines(), 1)
        if line.strip()
    ]
    lengths = {len(fields) for *_, fields in lines}
    if len(lengths) == 1 and lengths <= _POSE:
        lines = [(path, row, frame, _without_pose(fields)) for path, row, frame, fields in lines]
    outlined = any(len(fields) > 7 for *_, fields in lines)
    sixth = [fields[5] for *_, fields in lines if len(fields) == 6]
    are_ids = bool(sixth) and all(word.isdigit() for word in sixth) and any(int(word) > 1 for word in sixth)
    names, collected = _class_names(request.path), DetectionList(request.path)
    for path, row, frame, fields in lines:
        place = f"{path.name}, line {row}"
        values = [number(request.path, place, "field", word) for word in fields]
        label = names.get(int(values[0]), f"{values[0]:.0f}") if values else ""
        if outlined:
            box, score, mask = _outlined(request, place, values)
        else:
            box, score, mask = *_boxed(request, place, values, are_ids), None
        collected.add(place, frame, box, score, label, mask)
    return collected.done()


def _boxed(request: Request, place: str, values: list[float], sixth_is_id: bool) -> tuple[tuple[float, ...], float]:
    if not 5 <= len(values) <= 7:
        raise FormatError(request.path, place, f"{len(values)} numbers", "class, x, y, width, height, and perhaps more")
    (width, height), (_, x, y, wide, tall) = request.size, values[:5]
    if (largest := max((x, y, wide, tall), key=abs)) > 1.5 or largest < -1.5:
        raise FormatError(request.path, place, f"{largest:g}", "shares of the image, 0..1")
    score = values[5] if len(values) > 5 and not (len(values) == 6 and sixth_is_id) else 1.0
    return ((x - wide / 2) * width, (y - tall / 2) * height, wide * width, tall * height), score


def _without_pose(fields: list[str]) -> list[str]:
    """The fields of a line of a pose model without its keypoints."""
    after = (len(fields) - 5) % 17
    return fields[:5] + (fields[-after:] if after else [])


def _outlined(request: Request, place: str, values: list[float]) -> tuple[tuple[float, ...], float, Mask]:
    """Box, score and mask of class, u, v, u, v, ... and perhaps confidence and track id."""
    if len(values) % 2 == 1 and values[-1] > 1.5:  # no share of the image: an id
        values = values[:-1]
    score = values[-1] if len(values) % 2 == 0 else 1.0
    flat = values[1 : len(values) - (len(values) + 1) % 2]
    try:
        (shares,) = flat_polygons([flat]).outlines
        mask = polygons([shares * np.array(request.size)])
    except ValueError as error:
        raise FormatError(request.path, place, str(error), "class and 3 or more points") from error
    return mask.box(), score, mask


def _class_names(folder: Path) -> dict[int, str]:
    """Names of classes from classes.txt or data.yaml in the folder or above it."""
    for path in class_lists(folder):
        if path.name not in CLASS_LISTS:
            return _yaml_names(_text(path))
        return dict(enumerate(line.strip() for line in _text(path).splitlines() if line.strip()))
    return {}


def _yaml_names(text: str) -> dict[int, str]:
    """The entry `names` of a data set's YAML, as Ultralytics and its exporters write it."""
    rest = text.partition("names:")[2]
    first = rest.partition("\n")[0].strip()
    if first.startswith("["):
        return dict(enumerate(word.strip(" '\"") for word in rest[: rest.index("]")].strip(" [").split(",")))
    names: dict[int, str] = {}
    for line in rest.splitlines()[1:]:
        entry = _ENTRY.match(line)
        if entry is None:
            break
        names[int(entry[1]) if entry[1] else len(names)] = entry[2].strip()
    return names


def _text(path: Path) -> str:
    with reading(path, "a text file", SourceError):
        return read_text(path, limits.DETECTIONS_FILE)


def is_frame_of_results(data: Any) -> bool:
    """Whether parsed JSON is what `Results.to_json` gives of one frame."""
    return isinstance(data, list) and all(
        isinstance(one, dict) and isinstance(one.get("box"), dict) and "x1" in one["box"] for one in data
    )


def is_ultralytics_results(data: Any) -> bool:
    """Whether parsed JSON is a list of frames of `Results.to_json`, one of them not empty."""
    return isinstance(data, list) and any(data) and all(map(is_frame_of_results, data))


def read_ultralytics_results(request: Request, data: Any) -> Detections:
    """Detections of a list of frames, each the list that `Results.to_json` gives."""
    found = DetectionList(request.path)
    for frame, rows in enumerate(data):
        for index, row in enumerate(rows):
            place = f"frame {frame}, detection {index}"
            box, mask = required_value(request.path, place, row, "box"), None
            if segments := row.get("segments"):
                mask = _segments(request.path, place, segments)
            corners = [required_value(request.path, place, box, key) for key in ("x1", "y1", "x2", "y2")]
            found.add_corners(place, frame, corners, row.get("confidence", 1.0), str(row.get("name", "")), mask)
    return found.done(len(data))


def _segments(path: Path, place: str, segments: Any) -> Mask | None:
    """The mask of an outline; None where it has no area."""
    u, v = ([number(path, place, key, one) for one in required_value(path, place, segments, key)] for key in ("x", "y"))
    if len(u) != len(v):
        raise FormatError(path, place, f"segments of {len(u)} x and {len(v)} y", "as many of each")
    try:
        return polygons([np.column_stack([u, v])]) if len(u) > 2 else None
    except ValueError as error:
        raise FormatError(path, place, error, "an outline in pixels") from error
