"""The growing table of corrected ids of a run in progress, `RUN.h5.live_corrections.csv`."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from stseg.arrays import Rows
from stseg.io.outputs.whole_files import output_error, replacing
from stseg.io.untrusted import limits
from stseg.io.untrusted.numbers import parse_whole
from stseg.records.tables import CORRECTION

COLUMNS = CORRECTION.names or ()


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
