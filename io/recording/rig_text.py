"""The text of a rig file: one matrix row a line, units in comments, numbers to the last digit."""

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.geometry import Camera
from stseg.geometry.lens import COEFFICIENTS
from stseg.io.recording.recording import HOG, BodyPrior, CameraSource, Recording, Source
from stseg.io.toml import toml_string, toml_value

FORMAT = 1


def format_rig(recording: Recording, path: Path) -> str:
    """The text of a rig file at `path`, to which paths of streams are relative."""
    rig, grid = recording.rig, recording.rig.grid
    lines = [
        f"format = {FORMAT}",
        "",
        "[scene]",
        f"name = {toml_string(rig.name)}",
        f"frame_rate = {_number(rig.frame_rate)}  # frames per second",
        f"x = {_list(np.array(grid.x))}  # ground rectangle, metres",
        f"y = {_list(np.array(grid.y))}",
        *([] if grid.polygon is None else [f"polygon = {_rows(grid.polygon)}  # the part of it that counts"]),
        *([f"doors = {_rows(np.array(rig.doors))}  # where people come and go"] if rig.doors else []),
        *(["closed = true  # nobody crosses the border but through doors"] if rig.closed else []),
        "",
        "[grid]",
        f"cell = {_number(grid.cell)}  # side of a cell, metres",
        f"top = {_number(grid.top)}  # height of the uppermost plane, metres",
        f"planes = {grid.planes}  # at linspace(0, top, planes)",
        *_body_lines(recording.body),
    ]
    for camera, streams in zip(rig.cameras, recording.sources, strict=True):
        lines += ["", *_camera_lines(camera), *_stream_lines(streams, path.parent)]
    return "\n".join(lines) + "\n"


def _body_lines(body: BodyPrior) -> list[str]:
    sizes = [f"{name} = {_number(size)}" for name, size in asdict(body).items() if size is not None]
    return ["", "[body]  # sizes of the bodies that are watched, metres", *sizes] if sizes else []


def _camera_lines(camera: Camera) -> list[str]:
    pixels = "pixels" if camera.lens is None else "undistorted pixels"
    lines = [
        "[[camera]]",
        f"name = {toml_string(camera.name)}",
        f"size = [{camera.size[0]}, {camera.size[1]}]  # width, height, pixels",
        f"# homography: ground metres -> {pixels}",
        f"ground = {_rows(camera.ground)}",
        "# what one metre of height adds to the third column of ground",
        f"vertical = {_list(camera.vertical)}",
    ]
    if camera.lens is not None:
        matrix, distortion = _rows(camera.lens.matrix), _list(camera.lens.distortion)
        model, names = camera.lens.model, COEFFICIENTS[camera.lens.model][: len(camera.lens.distortion)]
        lines.append(f"# camera matrix; {', '.join(names)}")
        lines.append(f'lens = {{ model = "{model}", matrix = {matrix}, distortion = {distortion} }}')
    return lines


def _stream_lines(streams: CameraSource, folder: Path) -> list[str]:
    lines = [f"offset = {streams.offset}  # its frame k shows the scene at frame k + offset"]
    lines.append(f"source = {_source_text(streams.source, folder)}")
    if streams.images is not None:
        lines.append(f"images = {_source_text(streams.images, folder)}  # colour frames beside the detections")
    if streams.background is not None:
        lines.append(f"background = {_source_text(streams.background, folder)}  # the empty scene")
    if streams.on_missing != "error":
        lines.append(f"on_missing = {toml_string(streams.on_missing)}  # where the stream starts late or ends early")
    if streams.clock != "auto":
        lines.append(f"clock = {toml_string(streams.clock)}  # what says when its frames were taken")
    return lines


def _source_text(source: Source, folder: Path) -> str:
    def relative(path: Path | None) -> str | None:
        return None if path is None else _relative(path, folder).as_posix()

    paths = [relative(path) for path in (source.path, *source.more)]
    values = {
        "kind": source.kind,
        "path": source.address or (paths if source.more else paths[0]),
        "first_frame": source.first_frame or None,
        "frames": source.frames,
        "classes": source.classes or None,
        "score": float(source.least_score) or None,
        "view": source.view,
        "select": source.select or None,
        "image_list": relative(source.image_list),
        "appearance": relative(source.appearance),
        "detector": str(HOG) if source.detector == HOG else relative(source.detector),
        "features": relative(source.features),
        "columns": dict(source.columns) or None,
        "starts": [float(start) for start in source.starts] or None,
    }
    return f"{{ {', '.join(f'{key} = {toml_value(value)}' for key, value in values.items() if value is not None)} }}"


def _relative(path: Path, folder: Path) -> Path:
    if path.is_relative_to(folder):
        return path.relative_to(folder)
    return path if path.is_absolute() else Path(os.path.relpath(path, folder))


def _number(number: float) -> str:
    return repr(float(number))


def _list(numbers: Floats) -> str:
    return toml_value([float(number) for number in numbers])


def _rows(matrix: Floats) -> str:
    return "\n".join(["[", *(f"    {_list(row)}," for row in matrix), "]"])
