"""The files of a source: one, a list, or those of a pattern, in chronological order."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from stseg.errors import SourceError
from stseg.io.recording.image_stream import image_paths, is_image_source, is_pattern
from stseg.io.recording.recording import Source

_NUMBER = re.compile(r"(\d+)", re.ASCII)


def source_parts(source: Source, key: str) -> list[Source]:
    """One source for each file or folder that is a stream of its own.

    Raises
    ------
    SourceError
        Where a pattern of videos matches no file.
    """
    paths = [part for path in (source.path, *source.more) for part in _expanded(path, source.kind, key)]
    return [replace(source, path=path, more=(), starts=()) for path in paths]


def source_files(source: Source) -> Iterator[Path]:
    """Every file of a source; raises SourceError where there is none."""
    for part in source_parts(source, ""):
        yield from image_paths(part.path, "")


def _expanded(path: Path, kind: str, key: str) -> list[Path]:
    """The files of a pattern of videos, ordered by the numbers in their names; other paths unchanged."""
    if not path.name:  # such as /
        return [path]
    videos = kind == "video" or (kind == "masks" and not is_image_source(path.with_name(path.name.replace("*", "_"))))
    if not videos or not is_pattern(path) or path.is_file():
        return [path]
    found = sorted(path.parent.glob(path.name), key=numeric_order)
    if not found:
        raise SourceError(path, key, "no files", "videos")
    return found


def numeric_order(path: Path) -> list[tuple[int, str]]:
    """Sort key of file names: words in alphabetical order, numbers by value."""
    return [(int(word), "") if part % 2 else (-1, word) for part, word in enumerate(_NUMBER.split(path.name))]
