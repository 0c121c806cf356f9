"""Detections of one camera as text: CSV with a header, or MOTChallenge lines."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from stseg.arrays import Boxes, Flags, Floats, Ints
from stseg.errors import FormatError, SourceError

_NEEDED = ("frame", "left", "top", "width", "height")
_MOT = (0, 2, 3, 4, 5, 6)  # frame, (id), left, top, width, height, conf
_MAX_FRAMES = 2**31


@dataclass(frozen=True, slots=True)
class BoxTable:
    """All boxes of one view.

    Attributes
    ----------
    frames
        Number of frames; frames without boxes have no detections.
    frame : int64 (n,)
        The frame of each box, from 0, rising.
    pixel : float64 (n, 4)
        left, top, width, height.
    score : float64 (n,)
        0..1.
    """

    frames: int
    frame: Ints
    pixel: Floats
    score: Floats

    def at(self, frame: int) -> Boxes:
        """The boxes of one frame, in the file's order."""
        start, stop = np.searchsorted(self.frame, (frame, frame + 1))
        return Boxes(self.pixel[start:stop], self.score[start:stop])


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


def read_boxes(path: Path, first_frame: int = 0, frames: int | None = None) -> BoxTable:
    """Boxes of a whole file.

    The first line decides between two forms. CSV begins with a header that names frame, left, top, width, height
    and, perhaps, score, in any order, among columns that are ignored. MOTChallenge lines have no header: frame, id,
    left, top, width, height, conf, ... between commas or spaces, with conf -1 where it is unknown.

    Parameters
    ----------
    path
        The file.
    first_frame
        Number of the first frame in the file.
    frames
        Number of frames; None to end with the last frame that has a box.

    Raises
    ------
    SourceError
        Where the file cannot be read or has no frames.
    FormatError
        Where a line is not one of boxes; names it.
    """
    lines = _read_lines(path)
    _check(lines, first_frame, frames)
    values = lines.values
    score = values[:, 5] if values.shape[1] == 6 else np.ones(len(values))
    frame = values[:, 0].astype(np.int64) - first_frame
    if frames is None and not len(frame):
        raise SourceError(path, "", "no boxes", "some, or `frames` to say how many frames have none")
    order = np.argsort(frame, kind="stable")
    length = int(frame.max()) + 1 if frames is None else frames
    return BoxTable(length, frame[order], values[order, 1:5], score[order])


def _check(lines: _Lines, first_frame: int, frames: int | None) -> None:
    """Refuse rows that are no boxes."""
    frame = lines.values[:, 0]
    for column in range(lines.values.shape[1]):
        lines.refuse(~np.isfinite(lines.values[:, column]), column, "a finite number")
    lines.refuse(frame != np.floor(frame), 0, "a whole number")
    lines.refuse(frame < first_frame, 0, f"a frame from first_frame = {first_frame} on")
    count = _MAX_FRAMES if frames is None else frames
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
    number: list[int] = []
    rows_of_numbers: list[list[float]] = []
    for line, fields in rows:
        number.append(line)
        rows_of_numbers.append(_numbers(path, line, fields, columns))
    values = np.array(rows_of_numbers, float).reshape(-1, len(columns))
    if is_mot:
        values[:, 5:][values[:, 5:] == -1] = 1
    return _Lines(path, np.array(number, np.int64), values)


def _fields(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each line that is not blank."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise SourceError(path, "", error.strerror or error, "a file of boxes") from error
    except UnicodeDecodeError as error:
        raise FormatError(path, "", "bytes that are no text", "a text file in UTF-8") from error
    if "," not in next(filter(str.strip, lines), ""):
        yield from ((number, line.split()) for number, line in enumerate(lines, 1) if line.strip())
        return
    reader = csv.reader(lines, skipinitialspace=True)
    try:
        yield from ((reader.line_num, fields) for fields in reader if any(map(str.strip, fields)))
    except csv.Error as error:
        raise FormatError(path, f"line {reader.line_num}", error, "fields between commas") from error


def _mot_columns(path: Path, line: int, first: list[str]) -> tuple[int, ...]:
    # A file of boxes that lost its header would otherwise be read one column off.
    if len(first) > 1 and not (_is_number(first[1]) and float(first[1]).is_integer()):
        expected = "a whole number as in lines of MOTChallenge, or a header above"
        raise FormatError(path, f"line {line}", f"id {first[1]}", expected)
    return tuple(column for column in _MOT if column < max(len(first), 6))


def _header_columns(path: Path, line: int, header: list[str]) -> tuple[int, ...]:
    names = [name.strip().lower() for name in header]
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        expected = f"a header with {', '.join(_NEEDED)}, or lines of MOTChallenge"
        raise FormatError(path, f"line {line}", f"no column {', '.join(missing)}", expected)
    wanted = (*_NEEDED, "score") if "score" in names else _NEEDED
    return tuple(names.index(name) for name in wanted)


def _numbers(path: Path, line: int, fields: list[str], columns: tuple[int, ...]) -> list[float]:
    if len(fields) <= max(columns):
        raise FormatError(path, f"line {line}", f"{len(fields)} fields", f"at least {max(columns) + 1}")
    texts = [fields[column] for column in columns]
    try:
        return [float(text) for text in texts]
    except ValueError:
        found = next(text for text in texts if not _is_number(text))
        raise FormatError(path, f"line {line}", repr(found), "a number") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
