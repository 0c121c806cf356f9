"""Point correspondences between images and the scene: CSV with camera, u, v, x, y and perhaps z."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.errors import FormatError
from stseg.io.track_csv import read_rows
from stseg.io.untrusted import limits
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

    The file is CSV with a header; z, where there is such a column, may be empty for points on the ground. Further
    columns are ignored. FormatError where the file cannot be read, a column is missing, or a cell is no number.
    """
    rows: dict[str, list[tuple[int, list[float]]]] = {}
    header, given = read_rows(path, _NEEDED, limits.POINTS, skip_blanks=True)
    for line, words in given:
        row = dict(zip(header, words, strict=False))
        cells = [_number(path, line, name, row) for name in ("u", "v", "x", "y", "z")]
        name = row.get("camera", "").strip()
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


def _number(path: Path, line: int, column: str, row: dict[str, str]) -> float:
    cell = row.get(column, "").strip()
    if column == "z" and not cell:
        return 0.0
    number = parse_number(cell)
    if not abs(number) <= limits.NUMBER:
        raise FormatError(path, f"line {line}, column {column}", abbreviated(cell), "a finite number of usual size")
    return number
