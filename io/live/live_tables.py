"""The growing tables of a run in progress: tracks, `RUN.h5.live.csv`; corrections, `RUN.h5.live_corrections.csv`."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self, TextIO

import numpy as np

from stseg.arrays import Rows
from stseg.io.outputs.whole_files import output_errors, replacing
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import parse_number, parse_numbers, parse_whole
from stseg.records.tables import CORRECTION, TRAJECTORY

_COLUMNS = ("frame", "time", "id", "x", "y", "height", "score")
LIVE_HEADER = ",".join(_COLUMNS)
COLUMNS = CORRECTION.names or ()
_UNMEASURED = "nan"
"""A height that the frame did not measure."""
_IDS = 1 << 31
"""Largest id in a line."""


class LiveTable:
    """A CSV table, `frame_rate` frames per second, to which each window appends its tracks, flushed at once.

    Lines of an unfinished run in the file are kept, those of frames from `stop` on removed. Raises OutputError where it
    cannot be written, from every method.
    """

    def __init__(self, path: Path, frame_rate: float, stop: int) -> None:
        self.path, self._frame_rate = path, frame_rate
        lines = _whole_lines(path, stop, len(_COLUMNS), {0: limits.FRAMES, 2: _IDS})
        lines = [line for line in lines if _has_numbers(line)]
        self.rows = np.zeros(len(lines), TRAJECTORY)
        """TRAJECTORY (n,): frame, id, x, y of the kept lines."""
        for name in ("frame", "id", "x", "y"):
            self.rows[name] = [parse_number(line[_COLUMNS.index(name)]) for line in lines]
        _rewrite(path, _COLUMNS, lines)
        self._file: TextIO | None = None

    def __enter__(self) -> Self:
        with output_errors(self.path):
            self._file = self.path.open("a", newline="", encoding="utf-8")
        return self

    def __exit__(self, *reason: object) -> None:
        if self._file is not None:
            self._file.close()

    def append(self, rows: Rows) -> None:
        """Add TRAJECTORY rows."""
        if self._file is None:
            raise ValueError("a live table that is not open")
        with output_errors(self.path):
            csv.writer(self._file).writerows(map(self._line, rows))
            self._file.flush()

    def _line(self, row: np.void) -> Sequence[object]:
        frame = int(row["frame"])
        numbers = (f"{float(row[name]):.3f}" for name in ("x", "y", "height", "score"))
        return (frame, f"{frame / self._frame_rate:.3f}", int(row["id"]), *numbers)


class CorrectionTable:
    """A CSV table to which each decision appends its corrections; there is no file before the first.

    Lines of an unfinished run in the file are kept, those decided with frames from `stop` on removed. Raises
    OutputError where it cannot be written, from every method.
    """

    def __init__(self, path: Path, stop: int) -> None:
        self.path = path
        lines = _whole_lines(path, stop, len(COLUMNS), dict(enumerate((*(limits.FRAMES,) * 3, _IDS, _IDS))))
        self.rows = np.array([tuple(map(int, line)) for line in lines], CORRECTION)
        """CORRECTION (n,): the kept lines."""
        if lines:
            _rewrite(path, COLUMNS, lines)
        else:
            path.unlink(missing_ok=True)

    def append(self, rows: Rows) -> None:
        """Add CORRECTION rows."""
        with output_errors(self.path):
            begun = self.path.exists()
            with self.path.open("a", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([*([] if begun else [COLUMNS]), *rows.tolist()])


def _has_numbers(line: Sequence[str]) -> bool:
    """Whether place and score of a line of `LiveTable` are numbers, and its height where it has one."""
    x, y, height, score = line[3:]
    return parse_numbers([x, y, score] + [height] * (height != _UNMEASURED)) is not None


def _whole_lines(path: Path, stop: int, columns: int, whole: Mapping[int, int]) -> list[list[str]]:
    """Lines decided before `stop` with so many cells and, in some columns, whole numbers up to a bound.

    Incomplete lines are dropped; there are none where the file cannot be read.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            _, *lines = csv.reader(file)
    except (OSError, ValueError, csv.Error):
        return []
    found = [line for line in lines if len(line) == columns]
    found = [line for line in found if all(parse_whole(line[k], 0, most) is not None for k, most in whole.items())]
    return [line for line in found if int(line[0]) < stop]


def _rewrite(path: Path, columns: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    with replacing(path, overwrite=True) as part, part.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([columns, *lines])
