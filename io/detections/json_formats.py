"""Detectors and data sets in JSON: COCO, MMDetection, WILDTRACK and MultiviewX.

COCO: results of a detector (a list, which Detectron2 and `yolo val` write, too), and annotated data sets. MMDetection:
the output of `DetInferencer`, one file an image (its folder `preds`), or a list of them. WILDTRACK: a folder of JSON,
one file a frame, each with the boxes of all views.
"""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from stseg.errors import FormatError, SourceError
from stseg.io.detections.masks import Mask, flat_polygons, run_lengths
from stseg.io.detections.record import (
    DetectionList,
    Detections,
    Request,
    last_numbers,
    listed_frames,
    optional_value,
    read_json,
    require_size,
    required_tables,
    required_value,
)
from stseg.io.untrusted.values import abbreviated

_KEYS = ("xmin", "ymin", "xmax", "ymax")


def is_coco_results(data: Any) -> bool:
    """Whether parsed JSON is a list of COCO results."""
    return (
        isinstance(data, list)
        and bool(data)
        and isinstance(data[0], dict)
        and "image_id" in data[0]
        and ("bbox" in data[0] or "segmentation" in data[0])
    )


def is_dataset(data: Any) -> bool:
    """Whether parsed JSON is a COCO data set."""
    return isinstance(data, dict) and "images" in data and "annotations" in data


def read_coco_results(request: Request, data: Any) -> Detections:
    """Detections of COCO results, with the image list where the rig names one."""
    if request.source.image_list is None:
        return _collect(request, data, None, {})
    listed = read_json(request.source.image_list)
    if not (isinstance(listed, dict) and isinstance(listed.get("images"), list)):
        expected = "the images of COCO results: id and file_name of each"
        raise FormatError(request.source.image_list, "images", "nothing", expected)
    return _collect(request, data, listed["images"], _categories(request.source.image_list, listed))


def read_dataset(request: Request, data: Any) -> Detections:
    """Detections of a COCO data set: its annotations that are no crowds."""
    rows, images = (required_tables(request.path, "data set", data, key) for key in ("annotations", "images"))
    single = [one for one in rows if not one.get("iscrowd")]
    return _collect(request, single, images, _categories(request.path, data))


def _collect(request: Request, rows: Sequence[Any], images: Any, categories: Mapping[Any, str]) -> Detections:
    frame_of, frames = _frames(request, images) if images is not None else ({}, None)
    others = {_id(request.path, f"image {k}", one, "id") for k, one in enumerate(images or ())} - set(frame_of)
    found = DetectionList(request.path)
    for index, row in enumerate(rows):
        place = f"detection {index}"
        image = _id(request.path, place, row, "image_id")
        if images is None:
            frame = _own_number(request.path, place, image)
        elif image in frame_of:
            frame = frame_of[image]
        elif image in others:
            continue
        else:
            raise FormatError(request.path, place, f"image_id {image!r}", "the id of an image in the image list")
        category = _id(request.path, place, row, "category_id") if "category_id" in row else ""
        mask = _mask(request.path, place, row.get("segmentation"))
        box = row.get("bbox") or (mask.box() if mask is not None else required_value(request.path, place, row, "bbox"))
        found.add(place, frame, box, row.get("score", 1.0), categories.get(category, str(category)), mask)
    return found.done(frames)


def _frames(request: Request, images: Any) -> tuple[dict[Any, int], int | None]:
    """Frame of each image id among the selected images, and their number."""
    chosen = list[tuple[Any, str]]()
    for k, one in enumerate(images):
        number, name = _id(request.path, f"image {k}", one, "id"), str(one.get("file_name", ""))
        if not request.source.select or fnmatch(name, request.source.select):
            require_size(request, f"image {k}", one.get("width"), one.get("height"))
            chosen.append((number, name))
    if not chosen:
        found = f"no image like {request.source.select!r}"
        raise SourceError(request.path, "select", found, "a pattern of image names")
    frames, count = listed_frames(request.path, [name for _, name in chosen])
    return dict(zip((image for image, _ in chosen), frames.tolist(), strict=True)), count


def _own_number(path: Path, place: str, image: Any) -> int:
    """The frame of a result without an image list: the number that its image id is, or ends with."""
    if type(image) is int:
        return image
    numbers = last_numbers([image]) if isinstance(image, str) else None
    if numbers is None:
        raise FormatError(path, place, f"image_id {image!r}", "a number, or `images` in the rig: the image list")
    return int(numbers[0])


def _id(path: Path, place: str, values: Any, key: str) -> Any:
    if not isinstance(found := required_value(path, place, values, key), int | float | str):
        raise FormatError(path, place, f"{key} {abbreviated(found)}", "a number or a text")
    return found


def _categories(path: Path, data: Mapping[str, Any]) -> dict[Any, str]:
    return {
        _id(path, f"category {k}", one, "id"): str(one.get("name", one["id"]))
        for k, one in enumerate(optional_value(path, "data set", data, "categories", list))
    }


def _mask(path: Path, place: str, segmentation: Any) -> Mask | None:
    if not segmentation:
        return None
    try:
        if isinstance(segmentation, dict):
            return run_lengths(segmentation["size"], segmentation["counts"])
        return flat_polygons(segmentation)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise FormatError(path, place, f"a segmentation: {error}"[:100], "polygons, or run lengths") from error


def is_prediction(data: Any) -> bool:
    """Whether parsed JSON is the prediction of one image."""
    return isinstance(data, dict) and {"labels", "scores", "bboxes"} <= set(data)


def is_mmdetection(data: Any) -> bool:
    """Whether parsed JSON is a list of predictions, or the inferencer's dictionary around it."""
    rows = data.get("predictions") if isinstance(data, dict) else data
    return isinstance(rows, list) and bool(rows) and all(map(is_prediction, rows))


def read_mmdetection(request: Request, data: Any) -> Detections:
    """Detections of a list of predictions, one a frame."""
    rows = data["predictions"] if isinstance(data, dict) else data
    found = DetectionList(request.path)
    for frame, row in enumerate(rows):
        _add(request, found, f"frame {frame}", frame, row)
    return found.done(len(rows))


def _add(request: Request, found: DetectionList, place: str, frame: int, row: Any) -> None:
    keys = ("bboxes", "scores", "labels")
    boxes, scores, labels = (optional_value(request.path, place, row, key, list) for key in keys)
    masks = optional_value(request.path, place, row, "masks", list) if row.get("masks") else [None] * len(boxes)
    if not len(boxes) == len(scores) == len(labels) == len(masks):
        raise FormatError(request.path, place, "bboxes, scores, labels and masks of different lengths", "one each")
    for corners, score, label, mask in zip(boxes, scores, labels, masks, strict=True):
        try:
            drawn = None if mask is None else run_lengths(mask["size"], mask["counts"])
        except (ValueError, TypeError, KeyError, OverflowError) as error:
            raise FormatError(request.path, place, f"a mask: {error}"[:100], "run lengths as COCO's") from error
        found.add_corners(place, frame, corners, score, str(label), drawn)


def is_wildtrack(data: Any) -> bool:
    """Whether parsed JSON is one frame of annotations."""
    return isinstance(data, list) and bool(data) and isinstance(data[0], dict) and {"personID", "views"} <= set(data[0])


def read_wildtrack(request: Request, paths: list[Path], data: list[Any]) -> Detections:
    """Boxes of one view; -1 marks a person that the view does not show."""
    if request.source.view is None:
        raise FormatError(request.path, "view", "no number of the camera", "view = NUMBER in the rig's source, from 0")
    frames, count = listed_frames(request.path, [path.name for path in paths])
    found, has_view = DetectionList(request.path), False
    for path, frame, people in zip(paths, frames.tolist(), data, strict=True):
        for index, person in enumerate(people):
            place = f"{path.name}, person {index}"
            for view in required_tables(request.path, place, person, "views"):
                if required_value(request.path, place, view, "viewNum") != request.source.view:
                    continue
                has_view = True
                corners = [required_value(request.path, place, view, key) for key in _KEYS]
                if corners != [-1, -1, -1, -1]:
                    found.add_corners(place, frame, corners, label="person")
    if not has_view:
        expected = "the camera's number in the files: view"
        raise FormatError(request.path, f"view {request.source.view}", "no such viewNum", expected)
    return found.done(count)
