"""Detections of one camera as text: CSV with a header, or MOTChallenge lines."""

import csv
import math
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TextIO

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Singles
from stseg.errors import FormatError, SourceError
from stseg.io.detections.packed_numbers import packed
from stseg.io.detections.record import Detections
from stseg.io.untrusted import limits
from stseg.io.untrusted.numpy_files import read_npy
from stseg.io.untrusted.values import parse_number, require_once

_NEEDED = ("frame", "left", "top", "width", "height")
_FEATURES = "a .npy array of numbers, one row a detection"
_MOT = (0, 2, 3, 4, 5, 6)  # frame, (id), left, top, width, height, conf


@dataclass(frozen=True)
class _Lines:
    """The numbers of a file as they stand: float64 (n, 5 or 6), and the line that each row comes from."""

    path: Path
    number: Ints
    values: Floats

    def refuse(self, wrong: Flags, column: int, expected: str) -> None:
        """Raise FormatError for the first row that is wrong."""
        if wrong.any():
            row = int(np.argmax(wrong))
            name = (*_NEEDED, "score")[column]
            found = f"{name} {self.values[row, column]:g}"
            raise FormatError(self.path, f"line {self.number[row]}", found, expected)


def read_boxes(
    path: Path, first_frame: int = 0, frames: int | None = None, appearance: Path | None = None
) -> Detections:
    """Boxes of a whole file in the order of their frames, which count from 0.

    The first line decides between two forms. CSV begins with a header that names frame, left, top, width, height
    and, perhaps, score, in any order, among columns that are ignored. MOTChallenge lines have no header: frame, id,
    left, top, width, height, conf, ... between commas or spaces, with conf -1 where it is unknown.

    SourceError where the file cannot be read or has no frames; FormatError where a line is not one of boxes; names it.

    Parameters
    ----------
    path
        The file.
    first_frame
        Number of the first frame in the file.
    frames
        Number of frames; None to end with the last frame that has a box.
    appearance
        File of their appearance features; None without.
    """
    lines = _read_lines(path)
    _check(lines, first_frame, frames)
    values = lines.values
    score = values[:, 5] if values.shape[1] == 6 else np.ones(len(values))
    frame = values[:, 0].astype(np.int64) - first_frame
    if frames is None and not len(frame):
        raise SourceError(path, "", "no boxes", "some, or `frames` to say how many frames have none")
    order = np.argsort(frame, kind="stable")
    crowded = np.flatnonzero(frame[order][limits.BOXES_PER_FRAME :] == frame[order][: -limits.BOXES_PER_FRAME])
    if len(crowded):
        place = f"frame {frame[order][crowded[0]] + first_frame}"
        raise FormatError(path, place, f"more than {limits.BOXES_PER_FRAME} boxes", "no more")
    length = int(frame.max()) + 1 if frames is None else frames
    features = None if appearance is None else read_features(appearance, len(values))[order]
    numbers = packed(values[order, 1:5]), packed(score[order])
    return Detections(frame[order], *numbers, frames=length, features=features)


def _check(lines: _Lines, first_frame: int, frames: int | None) -> None:
    """Refuse rows that are no boxes."""
    frame = lines.values[:, 0]
    for column in range(lines.values.shape[1]):
        lines.refuse(~(np.abs(lines.values[:, column]) <= limits.NUMBER), column, "a finite number of usual size")
    lines.refuse(frame != np.floor(frame), 0, "a whole number")
    lines.refuse(frame < first_frame, 0, f"a frame from first_frame = {first_frame} on")
    count = limits.FRAMES if frames is None else frames
    reason = "" if frames is None else f", for there are frames = {frames}"
    lines.refuse(frame >= first_frame + count, 0, f"a frame below {first_frame + count}{reason}")
    for column in (3, 4):
        lines.refuse(lines.values[:, column] < 0, column, "0 or more pixels")
    for column in range(5, lines.values.shape[1]):
        lines.refuse((lines.values[:, column] < 0) | (lines.values[:, column] > 1), column, "a score of 0..1")


def _read_lines(path: Path) -> _Lines:
    """The needed columns; an unknown MOTChallenge score (-1) becomes 1."""
    rows = _fields(path)
    line, first = next(rows, (0, list(_NEEDED)))
    is_mot = _is_number(first[0])
    if is_mot:
        columns = _mot_columns(path, line, first)
        rows = chain([(line, first)], rows)
    else:
        columns = _header_columns(path, line, first)
    number, numbers = array("q"), array("d")
    for line, fields in rows:
        if not is_mot and any(map(str.strip, fields[len(first) :])):
            raise FormatError(path, f"line {line}", f"{len(fields)} fields", f"{len(first)}, as in the header")
        number.append(line)
        numbers.extend(_numbers(path, line, fields, columns))
        if len(number) > limits.ROWS:
            raise FormatError(path, f"line {line}", f"more than {limits.ROWS} rows", "no more")
    values = np.asarray(numbers).reshape(-1, len(columns))
    if is_mot:
        values[:, 5:][values[:, 5:] == -1] = 1
    return _Lines(path, np.asarray(number), values)


def _fields(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each line that is not blank."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            yield from _split(path, file)
    except OSError as error:
        raise SourceError(path, "", error.strerror or error, "a file of boxes") from error
    except UnicodeDecodeError as error:
        raise FormatError(path, "", "bytes that are no text", "a text file in UTF-8") from error
    except ValueError as error:
        raise FormatError(path, "", error, "a file of boxes") from error


def _split(path: Path, file: TextIO) -> Iterator[tuple[int, list[str]]]:
    """Fields between commas where the first line has one, else between blanks."""
    skipped = 0
    while (first := file.readline(limits.LINE)) and not first.strip():
        skipped += 1
    rest = chain([first], file) if first else iter(())
    if "," not in first:
        yield from ((number, line.split()) for number, line in enumerate(rest, skipped + 1) if line.strip())
        return
    reader = csv.reader(rest, skipinitialspace=True)
    try:
        begun = iter(lambda: skipped + reader.line_num + 1, None)  # a quoted cell may go on in later lines
        yield from ((line, row) for line, row in zip(begun, reader, strict=False) if any(map(str.strip, row)))
    except csv.Error as error:
        raise FormatError(path, f"line {skipped + reader.line_num}", error, "fields between commas") from error


def _mot_columns(path: Path, line: int, first: list[str]) -> tuple[int, ...]:
    # A file of boxes that lost its header would otherwise be read one column off.
    if len(first) > 1 and not (_is_number(first[1]) and parse_number(first[1]).is_integer()):
        expected = "a whole number as in lines of MOTChallenge, or a header above"
        raise FormatError(path, f"line {line}", f"id {first[1][: limits.NAME]}", expected)
    return tuple(column for column in _MOT if column < max(len(first), 6))


def _header_columns(path: Path, line: int, header: list[str]) -> tuple[int, ...]:
    names = [name.strip().lower() for name in header]
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        expected = f"a header with {', '.join(_NEEDED)}, or lines of MOTChallenge"
        raise FormatError(path, f"line {line}", f"no column {', '.join(missing)}", expected)
    require_once(path, names)
    wanted = (*_NEEDED, "score") if "score" in names else _NEEDED
    return tuple(names.index(name) for name in wanted)


def _numbers(path: Path, line: int, fields: list[str], columns: tuple[int, ...]) -> list[float]:
    if len(fields) <= max(columns):
        raise FormatError(path, f"line {line}", f"{len(fields)} fields", f"at least {max(columns) + 1}")
    numbers = [parse_number(fields[column]) for column in columns]
    if any(map(math.isnan, numbers)):
        wrong = next(place for place, number in enumerate(numbers) if math.isnan(number))
        found = f"{(*_NEEDED, 'score')[wrong]} {fields[columns[wrong]][: limits.NAME].strip() or 'nothing'}"
        raise FormatError(path, f"line {line}", found, "a finite number")
    return numbers


def _is_number(text: str) -> bool:
    return not math.isnan(parse_number(text))


def read_features(path: Path, detections: int) -> Singles:
    """Features of the detections of one file, in its order, float32 (detection, feature).

    SourceError, FormatError where the file cannot be read, or has another number of rows, or numbers that are not
    finite.
    """
    try:
        array = read_npy(path, limits.FEATURES_FILE + limits.LINE)
    except OSError as error:
        raise SourceError(path, "", error.strerror or error, _FEATURES) from error
    except ValueError as error:
        raise FormatError(path, "", error, _FEATURES) from error
    if array.ndim != 2 or array.dtype.kind not in "fiu" or not 1 <= array.shape[1] <= limits.FEATURES:
        raise FormatError(path, "", f"an array of {array.dtype} {array.shape}", _FEATURES)
    if len(array) != detections:
        raise FormatError(path, "", f"{len(array)} rows", f"{detections}, one a detection")
    if array.size and not -limits.NUMBER <= float(array.min()) <= float(array.max()) <= limits.NUMBER:  # nan neither
        raise FormatError(path, "", "a number that is not finite, or huge", "finite numbers of usual size")
    return array.astype(np.float32)
