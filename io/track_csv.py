"""Tables of ground positions as CSV: `frame,id,x,y` with a header, metres, one row per person and frame."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from stseg.arrays import Flags, Floats, Ints, Rows, repeated_rows
from stseg.errors import FormatError
from stseg.io.outputs.whole_files import replacing, require_output
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import require_regular
from stseg.io.untrusted.values import abbreviated, parse_number, require_once

POSITION = np.dtype([("frame", "<i8"), ("id", "<i8"), ("x", "<f8"), ("y", "<f8"), ("flag", "<i8")])
"""One row per person and frame: metres on the ground; a flag other than 0 marks an unreliable row."""

_NEEDED = ("frame", "id", "x", "y")
_WRITTEN = {
    "frame": "%d",
    "id": "%d",
    "x": "%.4f",
    "y": "%.4f",
    "height": "%.3f",
    "score": "%.3f",
    "xx": "%.4g",
    "xy": "%.4g",
    "yy": "%.4g",
    "views": "%d",
}


def read_tracks_csv(path: Path) -> Rows:
    """Read tracks or truth.

    Further columns are ignored. Ids that are not all whole numbers are numbered from 1 in order of appearance.

    Returns
    -------
    POSITION (n,)
        In the order of the file; flag is 0 where there is no such column.

    Raises
    ------
    FormatError
        Where the file cannot be read, a column is missing, a cell is not a (whole, finite) number, or an id occurs
        twice in a frame; it names the line and the column.
    """
    sheet = _read_sheet(Path(path))
    table = np.zeros(len(sheet.lines), POSITION)
    table["frame"] = sheet.whole("frame")
    sheet.refuse(np.abs(table["frame"]) > limits.FRAMES, "frame", f"a frame up to {limits.FRAMES}")
    table["id"] = sheet.identities()
    table["x"], table["y"] = sheet.numbers("x"), sheet.numbers("y")
    if "flag" in sheet.cells:
        table["flag"] = sheet.whole("flag", empty="0")
    sheet.refuse(repeated_rows(table, ("frame", "id")), "id", "an id once a frame", "{} again in the same frame")
    _refuse_crowds(path, table)
    return table


def write_tracks_csv(path: Path, trajectory: Rows, overwrite: bool = False) -> None:
    """Write a TRAJECTORY table as frame, id, x, y, height, score, xx, xy, yy, views; positions to 0.1 mm.

    A cell of nan is empty: in SQL one nan would make every mean nan.
    """
    header, line = (",".join(words) + "\n" for words in (_WRITTEN, _WRITTEN.values()))
    require_output(Path(path), overwrite, table=header)
    with replacing(Path(path), overwrite) as part, part.open("w", newline="", encoding="utf-8") as file:
        file.write(header)
        file.writelines((line % row).replace("nan", "") for row in trajectory[list(_WRITTEN)].tolist())


@dataclass(frozen=True, slots=True)
class _Sheet:
    """The cells of a CSV file by column, and the line number of each row."""

    path: Path
    lines: list[int]
    cells: dict[str, list[str]]

    def numbers(self, column: str, empty: str = "") -> Floats:
        """A column of finite numbers, float64 (n,); an empty cell reads as `empty`."""
        values = np.array([parse_number(cell or empty) for cell in self.cells[column]], float)
        self.refuse(~(np.abs(values) <= limits.NUMBER), column, "a finite number of usual size")
        return values

    def whole(self, column: str, empty: str = "") -> Ints:
        """A column of whole numbers, int64 (n,)."""
        values = self.numbers(column, empty)
        self.refuse((values != np.floor(values)) | (np.abs(values) > 2**53), column, "a whole number")
        return values.astype(np.int64)

    def identities(self) -> Ints:
        """The column id, int64 (n,)."""
        cells = self.cells["id"]
        self.refuse(np.array([not cell for cell in cells], bool), "id", "an id")
        try:
            values = np.array([int(cell) for cell in cells], np.int64)
        except (ValueError, OverflowError):
            values = None
        # 07 and 7 are two different ids: only numbers in plain form keep their value
        if values is None or [str(value) for value in values.tolist()] != cells:
            first = {cell: number for number, cell in enumerate(dict.fromkeys(cells), start=1)}
            values = np.array([first[cell] for cell in cells], np.int64)
        return values

    def refuse(self, wrong: Flags, column: str, expected: str, found: str = "{}") -> None:
        """Raise a FormatError that names the first wrong row, if there is one."""
        if wrong.any():
            row = int(np.argmax(wrong))
            cell = abbreviated(self.cells[column][row])
            raise FormatError(self.path, f"line {self.lines[row]}, column {column}", found.format(cell), expected)


def read_rows(
    path: Path, needed: Sequence[str], most: int, *, skip_blanks: bool = False
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Header and rows of a CSV file, each with the number of its line.

    With `skip_blanks`, blanks before a quotation mark are no part of the text. FormatError where the file cannot be
    read, lacks one of the columns `needed`, or has more than `most` rows.
    """
    try:
        require_regular(path)
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, skipinitialspace=skip_blanks)
            header = [name.strip().lower() for name in next(reader, [])]
            rows = list(islice(((reader.line_num, row) for row in reader if any(map(str.strip, row))), most + 1))
    except OSError as error:
        raise FormatError(path, "", error.strerror or error, "a CSV file that can be read") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise FormatError(path, "", "something that is not text", "a CSV file") from error
    if missing := [name for name in needed if name not in header]:
        found = ",".join(header)[: limits.NAME] or "nothing"
        raise FormatError(path, "header", found, f"columns {','.join(needed)} (no {', '.join(missing)})")
    require_once(path, header)
    if len(rows) > most:
        raise FormatError(path, f"line {rows[most][0]}", f"more than {most} rows", "no more")
    for line, row in rows:
        if any(map(str.strip, row[len(header) :])):
            raise FormatError(path, f"line {line}", f"{len(row)} cells", f"{len(header)}, as in the header")
    return header, rows


def _read_sheet(path: Path) -> _Sheet:
    header, rows = read_rows(path, _NEEDED, limits.ROWS)
    for line, row in rows:
        if len(row) != len(header):
            raise FormatError(path, f"line {line}", f"{len(row)} cells", f"{len(header)}, as in the header")
    wanted = [name for name in (*_NEEDED, "flag") if name in header]
    cells = {name: [row[header.index(name)].strip() for _, row in rows] for name in wanted}
    return _Sheet(Path(path), [line for line, _ in rows], cells)


def _refuse_crowds(path: Path, table: Rows) -> None:
    frames, counts = np.unique(table["frame"], return_counts=True)
    if counts.max(initial=0) > limits.PEOPLE_PER_FRAME:
        place = f"frame {frames[counts.argmax()]}"
        raise FormatError(path, place, f"{counts.max()} rows", f"at most {limits.PEOPLE_PER_FRAME} people in a frame")
