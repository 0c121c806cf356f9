"""A folder or pattern of image files as a stream, ordered by the running number in their names."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from stseg.arrays import AnyArray, Floats
from stseg.errors import SourceError
from stseg.geometry import Camera
from stseg.io.recording.pictures import read_picture, reduced_view
from stseg.io.recording.recording import Source

_SUFFIXES = frozenset((".bmp", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".pnm", ".ppm", ".tif", ".tiff", ".webp"))
_NUMBER = re.compile(r"(\d+)", re.ASCII)


class ImageStream:
    """Colour frames, masks or instance images from files (see `stseg.io.recording.pictures.read_picture`).

    Parameters
    ----------
    source, camera
        The files, and the camera whose size they must have.
    factor
        Whole factor by which colour frames are reduced.

    Raises
    ------
    SourceError
        Where there is no file, the files do not number their frames without gaps, or one of them is broken or not of
        the camera's size.
    """

    def __init__(self, source: Source, camera: Camera, factor: int = 1) -> None:
        self._source, self._camera, self._factor = source, camera, factor
        self._paths = image_paths(source.path, f"camera {camera.name}")
        self._next = 0

    def skip(self, count: int) -> int:
        """Skip up to `count` files; return how many there were."""
        skipped = min(count, len(self._paths) - self._next)
        self._next += skipped
        return skipped

    def read(self) -> AnyArray | None:
        """The next frame; None after the last."""
        if self._next == len(self._paths):
            return None
        frame, self._next = self._next, self._next + 1
        key = f"camera {self._camera.name}, frame {frame}"
        picture = read_picture(self._paths[frame], self._source.kind, self._camera.size, key)
        return np.asarray(reduced_view(picture, self._factor))

    def times(self) -> list[Floats]:
        """Image files have no time stamps."""
        return [np.full(self.skip(len(self._paths)), np.nan)]

    def close(self) -> None:
        """Nothing is held open."""


def is_detection_file(path: Path) -> bool:
    """Whether a path holds detections rather than images: JSON, XML, or a folder of text files."""
    if path.is_dir():
        return any(path.glob("*.txt")) or any(path.glob("*.json"))
    return path.suffix.lower() in (".json", ".jsonl", ".ndjson", ".xml")


def is_image_source(path: Path) -> bool:
    """Whether a path is an image, a folder or a pattern of images, rather than a video."""
    if path.suffix.lower() in _SUFFIXES or path.is_dir():
        return True
    return not path.is_file() and (is_pattern(path) or not path.suffix)


def image_paths(path: Path, key: str) -> list[Path]:
    """The files of a folder, of a pattern such as `frame_*.png`, or of a single image, in the order of their frames.

    Names may differ in one number only, which rises in equal steps, so that missing files are detected.
    """
    if path.is_file():
        return [path]
    if path.is_dir():
        found = [file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES]
    elif is_pattern(path):
        found = list(path.parent.glob(path.name))
    else:
        raise SourceError(path, key, "no such file or folder", "a folder or pattern of images")
    # Names that begin with a dot are made by file systems.
    files = sorted(file for file in found if file.is_file() and not file.name.startswith("."))
    if not files:
        raise SourceError(path, key, "no images", "one image a frame")
    return files if len(files) == 1 else _in_order(files, path, key)


def _in_order(files: list[Path], path: Path, key: str) -> list[Path]:
    """Files sorted by their running number."""
    parts = [_NUMBER.split(file.name) for file in files]
    words = {tuple(part[::2]) for part in parts}
    numbers = [tuple(map(int, part[1::2])) for part in parts]
    varying = [place for place, values in enumerate(zip(*numbers, strict=False)) if len(set(values)) > 1]
    if len(words) > 1 or len(varying) != 1:
        found = f"{files[0].name} beside {files[-1].name}"
        raise SourceError(path, key, found, "names that differ in one running number alone")
    order = sorted((number[varying[0]], file) for number, file in zip(numbers, files, strict=True))
    step = min(after - before for (before, _), (after, _) in pairwise(order))
    for (before, file), (after, twin) in pairwise(order):
        if step == 0 and before == after:
            raise SourceError(path, key, f"{file.name} and {twin.name}", "each number once")
        if after - before != step:
            raise SourceError(path, key, f"a gap after {file.name}", f"running numbers in steps of {step}")
    return [file for _, file in order]


def is_pattern(path: Path) -> bool:
    """Whether a path is a pattern of several files."""
    return any(sign in path.name for sign in "*?[")
