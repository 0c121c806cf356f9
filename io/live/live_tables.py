"""The growing tables of a run in progress: tracks, `RUN.h5.live.csv`; corrections, `RUN.h5.live_corrections.csv`."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self, TextIO

import numpy as np

from stseg.arrays import Rows
from stseg.io.outputs.whole_files import output_error, replacing
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import parse_number, parse_numbers, parse_whole
from stseg.records.tables import CORRECTION, TRAJECTORY

_COLUMNS = ("frame", "time", "id", "x", "y", "height", "score")
COLUMNS = CORRECTION.names or ()


class LiveTable:
    """A CSV table to which each window appends its tracks, flushed at once.

    Parameters
    ----------
    path
        The file. Lines of an unfinished run in it are kept.
    frame_rate
        Frames per second.
    stop
        Lines of frames from `stop` on are removed.

    Attributes
    ----------
    rows : TRAJECTORY (n,)
        The kept lines: frame, id, x, y.

    Raises
    ------
    OutputError
        Where it cannot be written; from every method.
    """

    def __init__(self, path: Path, frame_rate: float, stop: int) -> None:
        self.path, self._frame_rate = path, frame_rate
        lines = _lines_before(path, stop)
        self.rows = np.zeros(len(lines), TRAJECTORY)
        for name in ("frame", "id", "x", "y"):
            self.rows[name] = [parse_number(line[_COLUMNS.index(name)]) for line in lines]
        with replacing(path, overwrite=True) as part, part.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([_COLUMNS, *lines])
        self._file: TextIO | None = None

    def __enter__(self) -> Self:
        try:
            self._file = self.path.open("a", newline="", encoding="utf-8")
        except OSError as error:
            raise output_error(self.path, error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()

    def append(self, rows: Rows) -> None:
        """Add TRAJECTORY rows."""
        if self._file is None:
            raise ValueError("a live table that is not open")
        try:
            csv.writer(self._file).writerows(map(self._line, rows))
            self._file.flush()
        except OSError as error:
            raise output_error(self.path, error) from error

    def _line(self, row: np.void) -> Sequence[object]:
        frame = int(row["frame"])
        numbers = (f"{float(row[name]):.3f}" for name in ("x", "y", "height", "score"))
        return (frame, f"{frame / self._frame_rate:.3f}", int(row["id"]), *numbers)


def _lines_before(path: Path, stop: int) -> list[list[str]]:
    """Lines of frames before `stop`; incomplete lines are dropped."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            _, *lines = csv.reader(file)
    except (OSError, ValueError, csv.Error):
        return []
    return [line for line in lines if _is_row(line) and int(line[0]) < stop]


def _is_row(line: list[str]) -> bool:
    if len(line) != len(_COLUMNS) or parse_numbers(line[3:]) is None:
        return False
    return all(parse_whole(cell, 0, most) is not None for cell, most in ((line[0], limits.FRAMES), (line[2], 1 << 31)))


class CorrectionTable:
    """A CSV table to which each decision appends its corrections; there is no file before the first.

    Parameters
    ----------
    path
        The file. Lines of an unfinished run in it are kept.
    stop
        Lines decided with frames from `stop` on are removed.

    Attributes
    ----------
    rows : CORRECTION (n,)
        The kept lines.

    Raises
    ------
    OutputError
        Where it cannot be written; from every method.
    """

    def __init__(self, path: Path, stop: int) -> None:
        self.path = path
        lines = [line for line in _lines(path) if line[0] < stop]
        self.rows = np.array(lines, CORRECTION)
        if lines:
            with replacing(path, overwrite=True) as part, part.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([COLUMNS, *lines])
        else:
            path.unlink(missing_ok=True)

    def append(self, rows: Rows) -> None:
        """Add CORRECTION rows."""
        try:
            begun = self.path.exists()
            with self.path.open("a", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([*([] if begun else [COLUMNS]), *rows.tolist()])
        except OSError as error:
            raise output_error(self.path, error) from error


def _lines(path: Path) -> list[tuple[int, ...]]:
    """The whole lines of a table; none where it cannot be read."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            _, *lines = csv.reader(file)
    except (OSError, ValueError, csv.Error):
        return []
    most = (limits.FRAMES,) * 3 + (1 << 31,) * 2
    found = [
        tuple(parse_whole(cell, 0, one) for cell, one in zip(line, most, strict=True))
        for line in lines
        if len(line) == len(COLUMNS)
    ]
    return [tuple(number for number in line if number is not None) for line in found if None not in line]
