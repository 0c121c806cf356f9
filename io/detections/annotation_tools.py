"""Annotations: CVAT XML, Label Studio JSON and VIA JSON."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from stseg.errors import FormatError
from stseg.io.detections.masks import Polygons, polygons
from stseg.io.detections.record import (
    DetectionList,
    Detections,
    Request,
    listed_frames,
    number,
    optional_value,
    require_size,
    required_tables,
    required_value,
)
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_xml
from stseg.io.untrusted.values import abbreviated


def read_cvat(request: Request) -> Detections:
    """Boxes and polygons of CVAT's XML 1.1, of a video or of images; shapes outside the image are left out."""
    root = parse_xml(request.path, "CVAT's XML: <annotations>", limits.DETECTIONS_FILE)
    if root.tag != "annotations":
        raise FormatError(request.path, "", f"<{root.tag}>", "CVAT's XML: <annotations>")
    found, images = DetectionList(request.path), root.findall("image")
    if images:
        frames, count = listed_frames(request.path, [image.get("name", "") for image in images])
        for image, frame in zip(images, frames.tolist(), strict=True):
            require_size(request, f"image {image.get('name')}", image.get("width"), image.get("height"))
            for shape in image:
                _add_shape(request.path, found, f"image {image.get('name')}", frame, shape, shape.get("label", ""))
        return found.done(count)
    for size in root.iter("original_size"):
        require_size(request, "original_size", size.findtext("width"), size.findtext("height"))
    if len({track.get("task_id") for track in root.findall("track")}) > 1:
        raise FormatError(request.path, "task_id", "tracks of several tasks", "one camera, a task of its own")
    for track in root.findall("track"):
        for shape in track:
            if shape.get("outside") != "1":
                place = f"track {track.get('id')}, frame {shape.get('frame')}"
                frame = int(number(request.path, place, "frame", shape.get("frame", "")))
                _add_shape(request.path, found, place, frame, shape, track.get("label", ""))
    length = root.findtext("meta/task/size") or root.findtext("meta/job/size")
    return found.done(int(number(request.path, "meta", "size", length)) if length else None)


def _add_shape(path: Path, found: DetectionList, place: str, frame: int, shape: Any, label: str) -> None:
    if shape.tag == "box":
        corners = [shape.get(key, "") for key in ("xtl", "ytl", "xbr", "ybr")]
        found.add_corners(place, frame, corners, label=label)
    elif shape.tag == "polygon":
        mask = _polygon(path, place, (pair.split(",") for pair in shape.get("points", "").split(";")))
        found.add(place, frame, mask.box(), label=label, mask=mask)
    else:
        _refuse_area(path, place, shape.tag)


def _refuse_area(path: Path, place: str, kind: object) -> None:
    """FormatError for a shape that covers people but is not read; lines and points cover none."""
    if not isinstance(kind, str):
        raise FormatError(path, place, f"a shape {abbreviated(kind)}", "the name of its kind")
    if kind in _OTHER_AREAS:
        raise FormatError(path, place, f"a shape {kind}", "rectangles and polygons")


def _polygon(path: Path, place: str, points: Iterable[Sequence[object]], scale: Sequence[float] = (1, 1)) -> Polygons:
    try:
        pairs = [[number(path, place, "points", one) for one in (u, v)] for u, v in points]
        return polygons([np.array(pairs) * scale])
    except (TypeError, ValueError) as error:
        raise FormatError(path, place, f"points: {error}", "u,v of 3 or more points") from error


def is_label_studio(data: Any) -> bool:
    """Whether parsed JSON is a list of Label Studio's tasks."""
    return isinstance(data, list) and bool(data) and isinstance(data[0], dict) and "annotations" in data[0]


def read_label_studio(request: Request, data: Any) -> Detections:
    """Rectangles and polygons of images, one task a frame, or rectangles of one video, straight between keyframes."""
    found = DetectionList(request.path)
    results = [list(_label_studio_results(request.path, k, task)) for k, task in enumerate(data)]
    videos = [one for rows in results for one in rows if one.get("type") == "videorectangle"]
    if videos and len(data) > 1:
        raise FormatError(request.path, "", f"{len(data)} tasks", "one camera: its video alone, or a file for each")
    if videos:
        lengths, between = list[int](), 0
        for index, one in enumerate(videos):
            place = f"result {index}"
            value = required_value(request.path, place, one, "value")
            between += _add_video_track(request, found, place, value, limits.INTERPOLATED - between)
            lengths.append(int(number(request.path, place, "framesCount", value.get("framesCount", 0))))
        return found.done(max(lengths) or None)
    named = [optional_value(request.path, f"task {k}", task, "data", dict) for k, task in enumerate(data)]
    names = [str(next(iter(values.values()), k)) for k, values in enumerate(named)]
    frames, count = listed_frames(request.path, names)
    for k, (rows, frame) in enumerate(zip(results, frames.tolist(), strict=True)):
        for index, one in enumerate(rows):
            _add_result(request, found, f"task {k}, result {index}", frame, one)
    return found.done(count)


def _label_studio_results(path: Path, index: int, task: Any) -> Iterator[Any]:
    given = required_tables(path, f"task {index}", task, "annotations")
    kept = [annotation for annotation in given if not annotation.get("was_cancelled")]
    if len(kept) > 1:
        raise FormatError(path, f"task {index}", f"{len(kept)} annotations", "one, by one person")
    for annotation in kept:
        yield from required_tables(path, f"task {index}", annotation, "result")


def _add_result(request: Request, found: DetectionList, place: str, frame: int, one: Any) -> None:
    value, (width, height) = optional_value(request.path, place, one, "value", dict), request.size
    if one.get("type") == "rectanglelabels":
        x, y, wide, tall = (
            number(request.path, place, key, required_value(request.path, place, value, key)) / 100 for key in _PERCENT
        )
        label = _first(request.path, place, value, "rectanglelabels")
        found.add(place, frame, (x * width, y * height, wide * width, tall * height), label=label)
    elif one.get("type") == "polygonlabels":
        points = required_value(request.path, place, value, "points")
        mask = _polygon(request.path, place, points, (width / 100, height / 100))
        found.add(place, frame, mask.box(), label=_first(request.path, place, value, "polygonlabels"), mask=mask)
    elif "sequence" in value:
        raise FormatError(request.path, place, f"keyframes of {abbreviated(one.get('type'))}", "a videorectangle")
    else:
        _refuse_area(request.path, place, one.get("type"))


def _first(path: Path, place: str, value: Any, key: str) -> str:
    """The first label of a list that may be missing."""
    return str(next(iter(optional_value(path, place, value, key, list)), ""))


_PERCENT = ("x", "y", "width", "height")
_OTHER_AREAS = ("mask", "ellipse", "cuboid", "skeleton", "circle", "brushlabels", "ellipselabels")


def _add_video_track(request: Request, found: DetectionList, place: str, value: Any, most: int) -> int:
    """One video rectangle: frames count from 1 there; between two keyframes it is enabled in, it moves straight.

    The number of frames between its keyframes, at most `most`.
    """
    steps = required_tables(request.path, place, value, "sequence")
    label, size = _first(request.path, place, value, "labels"), np.array(request.size * 2)
    keys = ("frame", *_PERCENT)
    table = np.array(
        [
            [number(request.path, place, key, required_value(request.path, place, step, key)) for key in keys]
            for step in steps
        ]
    ).reshape(-1, 5)
    between = np.diff(table[:, 0]) - 1
    if (between < 0).any() or between.sum() > most:
        expected = f"rising frames, and at most {limits.INTERPOLATED} boxes between all keyframes"
        raise FormatError(request.path, place, "keyframes that do not rise, or are far apart", expected)
    on = [bool(step.get("enabled", True)) for step in steps]
    for k in range(len(steps)):
        stop = table[k + 1, 0] if on[k] and k + 1 < len(steps) else table[k, 0] + 1
        frames = np.arange(table[k, 0], stop)
        boxes = np.stack([np.interp(frames, table[:, 0], column) / 100 for column in table[:, 1:].T], -1) * size
        for frame, box in zip(frames.tolist(), boxes.tolist(), strict=True):
            found.add(place, int(frame) - 1, box, label=label)
    return int(between.sum())


def is_via(data: Any) -> bool:
    """Whether parsed JSON is a project or export of the VGG Image Annotator."""
    images = data.get("_via_img_metadata", data) if isinstance(data, dict) else None
    return (
        isinstance(images, dict)
        and bool(images)
        and all(isinstance(one, dict) and "filename" in one and "regions" in one for one in images.values())
    )


def read_via(request: Request, data: Any) -> Detections:
    """Rectangles and polygons of the VGG Image Annotator (VIA 2), one image a frame."""
    images = list(data.get("_via_img_metadata", data).values())
    frames, count = listed_frames(request.path, [str(image["filename"]) for image in images])
    found = DetectionList(request.path)
    for image, frame in zip(images, frames.tolist(), strict=True):
        regions = image["regions"]
        listed = {"regions": list(regions.values()) if isinstance(regions, dict) else regions}
        for index, region in enumerate(required_tables(request.path, str(image["filename"]), listed, "regions")):
            place = f"{image['filename']}, region {index}"
            shape = optional_value(request.path, place, region, "shape_attributes", dict)
            given = optional_value(request.path, place, region, "region_attributes", dict)
            label = str(next((value for value in given.values() if isinstance(value, str)), ""))
            if shape.get("name") == "rect":
                box = [required_value(request.path, place, shape, key) for key in _PERCENT]
                found.add(place, frame, box, label=label)
            elif shape.get("name") == "polygon":
                axes = [optional_value(request.path, place, shape, f"all_points_{a}", list) for a in "xy"]
                mask = _polygon(request.path, place, [*zip_longest(*axes)])
                found.add(place, frame, mask.box(), label=label, mask=mask)
            else:
                _refuse_area(request.path, place, shape.get("name"))
    return found.done(count)
