"""Detections of one camera as a detector or an annotation tool writes them, before frames are counted from 0.

Beside the record: its builder, JSON and its keys, and frame numbers from the names of files and images.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from stseg.arrays import Boxes, Flags, Ints, Singles
from stseg.errors import FormatError, SourceError, printable
from stseg.io.detections.masks import Mask
from stseg.io.detections.packed_numbers import Numbers, packed, rows_of
from stseg.io.recording.recording import Source
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_json, read_text, reading
from stseg.io.untrusted.values import abbreviated, finite_number, parse_number

LEAST_NUMBERS = ("frame", "left", "top", "width", "height", "score")
_DIGITS, _LAST_DIGITS = re.compile(r"[0-9]+"), re.compile(r"[0-9]+(?=[^0-9]*\Z)")
_ENDING = re.compile(r"(?<=[^/.])\.[^/.]+\Z")


@dataclass(frozen=True)
class Request:
    """Request to a reader: a source, and the width and height of its camera's image, pixels."""

    source: Source
    size: tuple[int, int]

    @property
    def path(self) -> Path:
        """File or folder."""
        return self.source.path


@dataclass(frozen=True)
class Detections:
    """All detections of one camera."""

    frame: Ints
    """int64 (n,): frame of each detection, as the source counts them."""
    pixel: Numbers
    """float64 (n, 4): left, top, width, height in pixels."""
    score: Numbers
    """float64 (n,): 0..1; 1 where the source gives none."""
    label: tuple[str, ...] = ()
    """Class of each detection: its name, or its number as text; empty where the source has no classes."""
    mask: tuple[Mask | None, ...] = ()
    """Mask of each detection, None where it has none; empty where the source has no masks."""
    frames: int | None = None
    """Number of frames where the source lists them all, counted from 0; None where it lists detections alone."""
    features: Singles | None = None
    """float32 (n, feature), or None: appearance features."""

    def __len__(self) -> int:
        return len(self.frame)

    def of(self, rows: Flags | Ints) -> Detections:
        """A subset, by index or mask; all of them in their order are not copied, since a day has millions."""
        index = np.flatnonzero(rows) if rows.dtype == bool else rows
        if np.array_equal(index, np.arange(len(self))):
            return self
        label = tuple(self.label[k] for k in index) if self.label else ()
        mask = tuple(self.mask[k] for k in index) if self.mask else ()
        features = None if self.features is None else self.features[index]
        pixel, score = rows_of(self.pixel, index), rows_of(self.score, index)
        return Detections(self.frame[index], pixel, score, label, mask, self.frames, features)

    def packed(self) -> Detections:
        """The same with packed numbers."""
        return replace(self, pixel=packed(self.pixel), score=packed(self.score))

    def at(self, frame: int) -> Boxes:
        """The boxes of one frame, in the order of the rows; their frames must rise."""
        start, stop = np.searchsorted(self.frame, (frame, frame + 1))
        features = None if self.features is None else self.features[start:stop]
        return Boxes(self.pixel[start:stop], self.score[start:stop], features)

    def classes(self) -> dict[str, int]:
        """Number of detections of each class, the most frequent first."""
        names, counts = np.unique(np.array(self.label, dtype=object), return_counts=True)
        return {str(names[k]): int(counts[k]) for k in np.argsort(-counts, kind="stable")}


Values = Sequence[object]
"""Values of a file, still to be checked."""


class DetectionList:
    """Collects detections of a file one by one, and refuses what is no box."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._numbers: list[tuple[float, ...]] = []
        self._label: list[str] = []
        self._mask: list[Mask | None] = []

    def __len__(self) -> int:
        return len(self._numbers)

    def add(
        self, place: str, frame: int, box: Values, score: object = 1.0, label: str = "", mask: Mask | None = None
    ) -> None:
        """Add a detection: left, top, width, height in pixels; `place` is where it stands in the file."""
        if abs(frame) > limits.FRAMES or len(self._numbers) >= limits.ROWS:
            found = f"frame {abbreviated(frame)}, row {len(self._numbers) + 1}"
            raise FormatError(self._path, place, found, f"at most {limits.FRAMES} frames and {limits.ROWS} rows")
        values = (number(self._path, place, "box", one) for one in (box if isinstance(box, list | tuple) else [box]))
        row = (float(frame), *values, number(self._path, place, "score", score))
        if len(row) != len(LEAST_NUMBERS):
            raise FormatError(self._path, place, f"a box of {len(row) - 2} numbers", "4 numbers")
        if row[3] < 0 or row[4] < 0:
            raise FormatError(self._path, place, f"a box {row[3]:g} by {row[4]:g} pixels", "0 or more pixels")
        if not 0 <= row[5] <= 1:
            raise FormatError(self._path, place, f"score {row[5]:g}", "a score of 0..1")
        self._numbers.append(row)
        self._label.append(printable(label[: limits.NAME]))
        self._mask.append(mask)

    def add_corners(
        self, place: str, frame: int, corners: Values, score: object = 1.0, label: str = "", mask: Mask | None = None
    ) -> None:
        """Add a detection by its left, top, right and bottom edges."""
        if not isinstance(corners, list | tuple) or len(corners) != 4:
            raise FormatError(self._path, place, f"a box {corners!r}"[:100], "4 numbers")
        left, top, right, bottom = (number(self._path, place, "box", one) for one in corners)
        self.add(place, frame, (left, top, right - left, bottom - top), score, label, mask)

    def done(self, frames: int | None = None) -> Detections:
        """All that were added."""
        values = np.array(self._numbers, float).reshape(-1, len(LEAST_NUMBERS))
        if frames is not None and not 0 <= frames <= limits.FRAMES:
            raise FormatError(self._path, "frames", f"{frames:.3g} of them", f"at most {limits.FRAMES}")
        crowded, crowds = np.unique(values[:, 0], return_counts=True)
        if crowds.max(initial=0) > limits.BOXES_PER_FRAME:
            place = f"frame {crowded[crowds.argmax()]:.0f}"
            raise FormatError(self._path, place, f"{crowds.max()} boxes", f"at most {limits.BOXES_PER_FRAME}")
        label = tuple(self._label) if any(self._label) else ()
        mask = tuple(self._mask) if any(one is not None for one in self._mask) else ()
        return Detections(values[:, 0].astype(np.int64), values[:, 1:5], values[:, 5], label, mask, frames)


def number(path: Path, place: str, name: str, value: object) -> float:
    """A finite number, or a FormatError."""
    if isinstance(value, np.generic):
        value = value.item()
    found = parse_number(value) if isinstance(value, str) else finite_number(value)
    if found is None or not abs(found) <= limits.NUMBER:
        raise FormatError(path, place, f"{name} {abbreviated(value)}", "a finite number of usual size")
    return found


def read_json(path: Path) -> Any:
    """Parsed JSON; of JSON lines, the list of the lines.

    SourceError, FormatError where the file cannot be read, or is no JSON: names the line.
    """
    with reading(path, "a file of detections", SourceError):
        text = read_text(path, limits.DETECTIONS_FILE)
    try:
        return parse_json(text)
    except ValueError as whole:
        lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
        if len(lines) < 2 or not _is_json(lines[0][1]):
            place = f"line {whole.lineno}" if isinstance(whole, json.JSONDecodeError) else ""
            raise FormatError(path, place, f"no JSON ({whole})"[:100], "JSON") from whole
    return [_line(path, number, line) for number, line in lines]


def _line(path: Path, number: int, line: str) -> Any:
    try:
        return parse_json(line)
    except ValueError as error:
        raise FormatError(path, f"line {number}", f"no JSON ({error})"[:100], "JSON, one value a line") from error


def _is_json(text: str) -> bool:
    try:
        parse_json(text)
    except ValueError:
        return False
    return True


def required_value(path: Path, place: str, values: Any, key: str) -> Any:
    """The value of a key; FormatError where it is missing."""
    if not isinstance(values, dict) or key not in values:
        raise FormatError(path, place, f"no {key}", f"the key {key}")
    return values[key]


def optional_value(path: Path, place: str, values: Any, key: str, kind: type[dict[str, Any] | list[Any]]) -> Any:
    """The list, or the values by name, of a key; empty where it is missing, FormatError for another type."""
    found = values.get(key, kind())
    if not isinstance(found, kind):
        raise FormatError(path, place, f"{key} {abbreviated(found)}", "a list" if kind is list else "values by name")
    return found


def required_tables(path: Path, place: str, values: Any, key: str) -> list[dict[str, Any]]:
    """The list of a key, each with values by name; FormatError where it is missing or another."""
    found = required_value(path, place, values, key)
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise FormatError(path, place, f"{key} {abbreviated(found)}", "a list, each with values by name")
    return found


def require_size(request: Request, place: str, width: object, height: object) -> None:
    """FormatError where a file says another size of images than the camera's; without numbers above 0 it says none."""
    sides = (("width", width), ("height", height))
    given = tuple(0.0 if side is None else number(request.path, place, name, side) for name, side in sides)
    if min(given) > 0 and given != request.size:
        found, expected = (f"images of {size[0]:g}x{size[1]:g}" for size in (given, request.size))
        raise FormatError(request.path, place, found, f"{expected}, as the camera has")


def last_numbers(names: Sequence[str]) -> Ints | None:
    """The last number in each name, int64 (n,); None where a name has none or two share one."""
    found = [_DIGITS.findall(PurePath(name).stem) for name in names]
    numbers = [int(digits[-1][-15:]) for digits in found if digits]
    return None if len(set(numbers)) < len(names) else np.array(numbers, np.int64)


def listed_frames(path: Path, names: Sequence[str]) -> tuple[Ints, int | None]:
    """Frames of images that a file lists, int64 (n,), and their count.

    Images at equal steps are consecutive frames, counted from 0; with unequal gaps their numbers are the frames, and
    the count is unknown. Names without usable numbers are frames in the order of the list. FormatError where names are
    those of several cameras, such as cam1/0.png, cam1/1.png, cam2/0.png and cam2/1.png.
    """
    numbers = last_numbers(names)
    if numbers is None:
        series = Counter(_LAST_DIGITS.sub("", _ENDING.sub("", name)) for name in names)
        if len(series) > 1 and min(series.values()) > 1:
            raise FormatError(path, "", f"images of {len(series)} cameras", "one camera: `select`, or a file for each")
        return np.arange(len(names), dtype=np.int64), len(names)
    if len(numbers) < 2:
        return np.zeros(len(numbers), np.int64), len(names)
    step = int(np.gcd.reduce(np.diff(np.sort(numbers))))
    ranks = (numbers - numbers.min()) // step
    if int(ranks.max()) + 1 == len(numbers):
        return ranks, len(names)
    return numbers, None
