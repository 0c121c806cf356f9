"""Formats of detections."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from fuzz import corpus as files
from fuzz.target import Target, plain
from stseg.geometry import Camera
from stseg.io.recording.recording import Source, SourceKind
from stseg.io.recording.streams import open_stream

CAMERA = Camera("cam1", (64, 48), np.eye(3), np.array([0.0, 0.0, -1.0]))
FRAMES = 20


def frames_of(source: Source) -> None:
    """Read the first frames."""
    stream = open_stream(source, CAMERA)
    for _ in range(FRAMES):
        if stream.read() is None:
            break
    stream.close()


def frames(kind: SourceKind) -> Callable[[Path], object]:
    """Read the first frames of a file."""
    return lambda path: frames_of(Source(kind, path))


def _mapped(path: Path) -> None:
    frames_of(Source("boxes", path, columns=(("frame", "t"), ("left", "x1"), ("score", "conf")), classes=("person",)))


def _images_of_coco(path: Path) -> None:
    results = path.with_name("results.json")
    results.write_bytes(files.COCO)
    frames_of(Source("boxes", results, image_list=path, select="a_*"))


def _in_folder(
    name: str, kind: SourceKind = "boxes", *beside: tuple[str, bytes], view: int | None = None
) -> Callable[[Path], object]:
    """The file as one of a folder, under a name that numbers a frame; others may lie beside or above it."""

    def read(path: Path) -> None:
        folder = path.with_name("frames")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for other, data in beside:
            (folder / other).write_bytes(data)
        (folder / name).write_bytes(path.read_bytes())
        frames_of(replace(Source(kind, folder), view=view))

    return read


DETECTION_TARGETS = (
    Target("boxes.csv", plain(files.BOXES), frames("boxes")),
    Target("mot.txt", plain(files.MOT), frames("boxes")),
    Target("mot_truth.txt", plain(files.MOT_TRUTH), frames("boxes")),
    Target("mapped.csv", plain(files.MAPPED), _mapped),
    Target("boxes.parquet", files.parquet, frames("boxes")),
    Target("yolo.txt", plain(files.YOLO), _in_folder("a_1.txt", "boxes", ("a_0.txt", files.YOLO))),
    Target("yolo_outlines.txt", plain(files.YOLO_OUTLINES), _in_folder("a_1.txt", "instances")),
    Target("yolo_names.yaml", plain(files.YOLO_NAMES), _in_folder("data.yaml", "boxes", ("a_0.txt", files.YOLO))),
    Target("yolo_frame.json", plain(files.YOLO_LINES.splitlines()[0]), _in_folder("a_1.json")),
    Target("yolo.json", plain(files.YOLO_JSON), frames("instances")),
    Target("yolo.jsonl", plain(files.YOLO_LINES), frames("boxes")),
    Target("mmdetection_frame.json", plain(files.MMDETECTION), _in_folder("a_1.json", "instances")),
    Target("mmdetection.json", plain(files.MMDETECTION_LIST), frames("boxes")),
    Target("wildtrack.json", plain(files.WILDTRACK), _in_folder("00000005.json", view=0)),
    Target("coco.json", plain(files.COCO), frames("boxes")),
    Target("coco_images.json", plain(files.COCO_DATA), _images_of_coco),
    Target("coco_data.json", plain(files.COCO_DATA), frames("instances")),
    Target("cvat.xml", plain(files.CVAT), frames("instances")),
    Target("cvat_images.xml", plain(files.CVAT_IMAGES), frames("instances")),
    Target("label_studio.json", plain(files.LABEL_STUDIO), frames("instances")),
    Target("label_studio_video.json", plain(files.LABEL_STUDIO_VIDEO), frames("boxes")),
    Target("via.json", plain(files.VIA), frames("instances")),
)  # fmt: skip
