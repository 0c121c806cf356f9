"""Boxes of all views as annotations that people mend: COCO, CVAT and Label Studio.

Frames are the recording's, and edges are pixels of the real image. `stseg` reads each of these formats as boxes.
"""

import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from stseg.arrays import Rows, by_track
from stseg.geometry import Camera
from stseg.io.exports.benchmarks import write_zip
from stseg.io.outputs.whole_files import MARK
from stseg.io.runfile.reading.run_reader import Run

_EDGES = ("left", "top", "width", "height")
_PERSON = "person"
_VIDEO_BOX = {"type": "videorectangle", "from_name": "box", "to_name": "video"}


def write_coco(path: Path, run: Run) -> None:
    """Write a COCO data set: an image `CAMERA/FRAME.png` for each view of each frame, boxes with `track_id`."""
    cameras = run.recording.rig.cameras
    images = [_coco_image(k, *pair) for k, pair in enumerate(product(run.frames.tolist(), cameras), start=1)]
    image = run.boxes["view"] + 1 + np.searchsorted(run.frames, run.boxes["frame"]) * len(cameras)
    boxes = zip(image.tolist(), run.boxes, strict=True)
    annotations = [_coco_box(k, *pair) for k, pair in enumerate(boxes, start=1)]
    about = {"description": f"{run.scene}, {MARK.decode()}"}
    categories = [{"id": 1, "name": _PERSON}]
    data = {"info": about, "images": images, "annotations": annotations, "categories": categories}
    path.write_text(json.dumps(data), encoding="utf-8")


def _coco_image(number: int, frame: int, camera: Camera) -> dict[str, object]:
    width, height = camera.size
    file = f"{camera.name}/{frame:06d}.png"
    return {"id": number, "file_name": file, "width": width, "height": height, "frame": frame}


def _coco_box(number: int, image: int, row: np.void) -> dict[str, object]:
    box, area = [round(float(row[name]), 2) for name in _EDGES], round(float(row["width"]) * float(row["height"]), 2)
    about = {"id": number, "image_id": image, "category_id": 1, "track_id": int(row["id"]), "iscrowd": 0}
    return {**about, "bbox": box, "area": area}


def write_cvat(path: Path, run: Run) -> None:
    """Write a zip of CVAT's XML 1.1 for videos, `CAMERA.xml` each: a track a person, a box in each frame."""
    write_zip(path, ((f"{camera}.xml", _cvat(run, view)) for view, camera in enumerate(run.cameras)))


def _cvat(run: Run, view: int) -> str:
    size, stop = run.recording.rig.cameras[view].size, int(run.frames[-1]) + 1 if len(run.frames) else 0
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        "<annotations>",
        "<version>1.1</version>",
        "<meta><task>",
        f"<size>{stop}</size><mode>interpolation</mode>",
        f"<labels><label><name>{_PERSON}</name></label></labels>",
        f"<original_size><width>{size[0]}</width><height>{size[1]}</height></original_size>",
        "</task></meta>",
    ]
    for identity, rows in _tracks(run, view):
        lines.append(f'<track id="{identity}" label={quoteattr(_PERSON)}>')
        ends = np.append(np.diff(rows["frame"]) > 1, True)
        for row, is_end in zip(rows, ends.tolist(), strict=True):
            lines.append(_cvat_box(row, int(row["frame"]), 0))
            if is_end and row["frame"] + 1 < stop:
                lines.append(_cvat_box(row, int(row["frame"]) + 1, 1))
        lines.append("</track>")
    return "\n".join([*lines, "</annotations>", ""])


def _cvat_box(row: Rows, frame: int, outside: int) -> str:
    left, top, width, height = (float(row[name]) for name in _EDGES)
    edges = f'xtl="{left:.2f}" ytl="{top:.2f}" xbr="{left + width:.2f}" ybr="{top + height:.2f}"'
    return f'<box frame="{frame}" outside="{outside}" occluded="0" keyframe="1" {edges} z_order="0"></box>'


def write_label_studio(path: Path, run: Run) -> None:
    """Write a zip of Label Studio's tasks, `CAMERA.json` each: a video rectangle a person, a keyframe in each frame."""
    write_zip(path, ((f"{camera}.json", json.dumps(_task(run, view))) for view, camera in enumerate(run.cameras)))


def _task(run: Run, view: int) -> list[dict[str, object]]:
    size, stop = run.recording.rig.cameras[view].size, int(run.frames[-1]) + 1 if len(run.frames) else 0
    result: list[dict[str, object]] = []
    for identity, rows in _tracks(run, view):
        sequence = _keyframes(rows, size, run.frame_rate)
        value = {"framesCount": stop, "labels": [_PERSON], "sequence": sequence}
        result.append({"id": f"track{identity}", **_VIDEO_BOX, "value": value})
    return [{"data": {"video": f"{run.cameras[view]}.mp4"}, "annotations": [{"result": result}]}]


def _keyframes(rows: Rows, size: tuple[int, int], frame_rate: float) -> list[dict[str, object]]:
    """Frames count from 1 there, and edges are percent; a box is there until a keyframe that is not enabled."""
    goes_on = np.append(np.diff(rows["frame"]) == 1, False)
    keyframes = []
    for row, is_on in zip(rows, goes_on.tolist(), strict=True):
        frame, (left, top, width, height) = int(row["frame"]), (100 * float(row[name]) for name in _EDGES)
        box = {"x": left / size[0], "y": top / size[1], "width": width / size[0], "height": height / size[1]}
        time = {"frame": frame + 1, "time": round(frame / frame_rate, 3), "rotation": 0, "enabled": is_on}
        keyframes.append(time | box)
    return keyframes


def _tracks(run: Run, view: int) -> Iterator[tuple[int, Rows]]:
    """Boxes of one view, track by track in the order of frames."""
    for rows in by_track(run.boxes[run.boxes["view"] == view]):
        yield int(rows["id"][0]), rows
