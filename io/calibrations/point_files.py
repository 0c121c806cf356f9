"""Point correspondences between images and the scene: CSV with camera, u, v, x, y and perhaps z."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.errors import FormatError
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import require_regular
from stseg.io.untrusted.values import EXPECTED, abbreviated, is_name, parse_number

_NEEDED = ("camera", "u", "v", "x", "y")


@dataclass(frozen=True)
class PointTable:
    """Point correspondences of one camera."""

    file: Path
    """The file."""
    camera: str
    """Its name."""
    pixel: Floats
    """float64 (n, 2): u, v; pixel centres at integers."""
    place: Floats
    """float64 (n, 3): x, y, z in the file's unit; z is 0 where the file has none."""
    line: Ints
    """int64 (n,): lines of the file."""


def read_points(path: Path) -> list[PointTable]:
    """The points of every camera, in the order in which the file first names them.

    Parameters
    ----------
    path
        CSV with a header; z, where there is such a column, may be empty for points on the ground. Further columns are
        ignored.

    Raises
    ------
    FormatError
        Where the file cannot be read, a column is missing, or a cell is no number.
    """
    rows: dict[str, list[tuple[int, list[float]]]] = {}
    for line, row in _rows(path):
        cells = [_number(path, line, name, row) for name in ("u", "v", "x", "y", "z")]
        name = (row["camera"] or "").strip()
        if not is_name(name):
            strange = abbreviated(name) if name else "nothing"
            raise FormatError(path, f"line {line}, column camera", strange, f"a camera's name: {EXPECTED}")
        rows.setdefault(name, []).append((line, cells))
    if not rows:
        raise FormatError(path, "", "no points", "a line a point")
    tables = []
    for name, found in rows.items():
        values = np.array([cells for _, cells in found])
        lines = np.array([line for line, _ in found])
        tables.append(PointTable(path, name, values[:, :2], values[:, 2:], lines))
    return tables


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        require_regular(path)
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            header = [name.strip() for name in reader.fieldnames or []]
            if missing := [name for name in _NEEDED if name not in header]:
                found = ",".join(header)[: limits.NAME] or "nothing"
                raise FormatError(path, "header", found, f"columns {','.join(_NEEDED)} (no {', '.join(missing)})")
            reader.fieldnames = header
            rows = [(reader.line_num, row) for row in islice(reader, limits.POINTS + 1)]
            if len(rows) > limits.POINTS:
                raise FormatError(path, "", f"more than {limits.POINTS} points", "no more")
            return rows
    except OSError as error:
        raise FormatError(path, "", error.strerror or error, "a CSV file that can be read") from error
    except (ValueError, csv.Error) as error:
        raise FormatError(path, "", "something that is not text", "a CSV file") from error


def _number(path: Path, line: int, column: str, row: dict[str, str]) -> float:
    cell = (row.get(column) or "").strip()
    if column == "z" and not cell:
        return 0.0
    number = parse_number(cell)
    if not abs(number) <= limits.NUMBER:
        raise FormatError(path, f"line {line}, column {column}", abbreviated(cell), "a finite number of usual size")
    return number
