"""The files of a source: one, a list, or those of a pattern, in chronological order."""

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path

from stseg.errors import SourceError
from stseg.io.recording.recording import HOG, Recording, Source

_SUFFIXES = frozenset((".bmp", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".pnm", ".ppm", ".tif", ".tiff", ".webp"))
_NUMBER = re.compile(r"(\d+)", re.ASCII)
CLASS_LISTS = ("classes.txt", "obj.names", "names.txt")
"""Lists of the names of classes beside detections in text."""


def source_parts(source: Source, key: str) -> list[Source]:
    """One source for each file or folder that is a stream of its own.

    SourceError where a pattern of videos matches no file.
    """
    paths = [part for path in (source.path, *source.more) for part in _expanded(path, source.kind, key)]
    return [replace(source, path=path, more=(), starts=()) for path in paths]


def source_files(source: Source) -> Iterator[Path]:
    """Every file that is read for a source, none for an address; raises SourceError where there is none."""
    if source.address:
        return
    for part in source_parts(source, ""):
        if part.path.is_dir() and is_detection_file(part.path):
            yield from sorted(file for file in part.path.iterdir() if file.is_file())
            yield from islice(class_lists(part.path), 1)
        else:
            yield from image_paths(part.path, "")
    model = None if source.detector == HOG else source.detector
    others = (source.image_list, source.appearance, model, source.features)
    yield from (path for path in others if path is not None)


def recording_files(recording: Recording) -> Iterator[Path]:
    """The rig file, and every file of the sources that are there."""
    yield recording.path
    for feed in recording.sources:
        for source in (feed.source, feed.background, feed.images):
            with suppress(OSError, SourceError):
                yield from source_files(source) if source is not None else ()


def class_lists(folder: Path) -> Iterator[Path]:
    """Files with names of classes in a folder of detections and the two above it; the first one counts."""
    for place in (folder, folder.parent, folder.parent.parent):
        yield from (place / name for name in (*CLASS_LISTS, "data.yaml", "data.yml") if (place / name).is_file())


def files_of_pattern(pattern: Path) -> Iterator[Path]:
    """The files of a pattern; two stars are one, not all folders within."""
    return pattern.parent.glob(re.sub(r"\*+", "*", pattern.name))


def _expanded(path: Path, kind: str, key: str) -> list[Path]:
    """The files of a pattern of videos, ordered by the numbers in their names; other paths unchanged."""
    if not path.name:  # such as /
        return [path]
    videos = kind == "video" or (kind == "masks" and not is_image_source(path.with_name(path.name.replace("*", "_"))))
    if not videos or not is_pattern(path) or path.is_file():
        return [path]
    found = sorted(files_of_pattern(path), key=numeric_order)
    if not found:
        raise SourceError(path, key, "no files", "videos")
    return found


def numeric_order(path: Path) -> list[tuple[int, str]]:
    """Sort key of file names: words in alphabetical order, numbers by value."""
    return [(int(word), "") if part % 2 else (-1, word) for part, word in enumerate(_NUMBER.split(path.name))]


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
        found = list(files_of_pattern(path))
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
