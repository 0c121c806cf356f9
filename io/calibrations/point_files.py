"""Point correspondences between images and the scene: CSV with camera, u, v, x, y and perhaps z."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.errors import FormatError

_NEEDED = ("camera", "u", "v", "x", "y")


@dataclass(frozen=True)
class PointTable:
    """Point correspondences of one camera.

    Attributes
    ----------
    file
        The file.
    camera
        Its name.
    pixel : float64 (n, 2)
        u, v; pixel centres at integers.
    place : float64 (n, 3)
        x, y, z in the file's unit; z is 0 where the file has none.
    line : int64 (n,)
        Lines of the file.
    """

    file: Path
    camera: str
    pixel: Floats
    place: Floats
    line: Ints


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
        if not name:
            raise FormatError(path, f"line {line}, column camera", "nothing", "a camera's name")
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
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            header = [name.strip() for name in reader.fieldnames or []]
            if missing := [name for name in _NEEDED if name not in header]:
                found = ",".join(header) or "nothing"
                raise FormatError(path, "header", found, f"columns {','.join(_NEEDED)} (no {', '.join(missing)})")
            reader.fieldnames = header
            return [(reader.line_num, row) for row in reader]
    except OSError as error:
        raise FormatError(path, "", error.strerror or error, "a CSV file that can be read") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise FormatError(path, "", "something that is not text", "a CSV file") from error


def _number(path: Path, line: int, column: str, row: dict[str, str]) -> float:
    cell = (row.get(column) or "").strip()
    if column == "z" and not cell:
        return 0.0
    try:
        number = float(cell)
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise FormatError(path, f"line {line}, column {column}", repr(cell), "a finite number")
    return number
