"""CSV, Parquet and JSON tables of boxes with columns of any names, and MOTChallenge's ground truth (`gt.txt`)."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stseg.errors import FormatError, one_of
from stseg.io.detections.record import DetectionList, Detections, Request, number, required_value
from stseg.io.extras import load_extra
from stseg.io.track_csv import read_rows
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_text, reading
from stseg.io.untrusted.values import parse_number

COLUMNS = ("frame", "left", "top", "width", "height", "right", "bottom", "x", "y", "score", "class")
"""Our names of columns; x and y are the middle of a box."""
_SYNONYMS = {
    "frame": ("frame_id", "frame_number", "frame_idx", "frame_index", "image", "t"),
    "left": ("x1", "xmin", "bb_left", "xtl", "min_x", "x_min"),
    "top": ("y1", "ymin", "bb_top", "ytl", "min_y", "y_min"),
    "right": ("x2", "xmax", "xbr", "max_x", "x_max"),
    "bottom": ("y2", "ymax", "ybr", "max_y", "y_max"),
    "width": ("w", "bb_width"),
    "height": ("h", "bb_height"),
    "x": ("cx", "x_center", "xc", "center_x"),
    "y": ("cy", "y_center", "yc", "center_y"),
    "score": ("conf", "confidence", "probability"),
    "class": ("label", "category", "name", "class_name", "class_id"),
}
CLASS_NAMES = frozenset(("class", *_SYNONYMS["class"]))
_FORMS = (("left", "top", "width", "height"), ("left", "top", "right", "bottom"), ("x", "y", "width", "height"))
_CLASSES = (
    *("", "pedestrian", "person on vehicle", "car", "bicycle", "motorbike", "vehicle", "static person", "distractor"),
    *("occluder", "occluder on the ground", "occluder full", "reflection"),
)
"""By number, from MOT16 on (Milan et al., MOT16: a benchmark for multi-object tracking, 2016)."""


def read_csv(request: Request) -> Detections:
    """Boxes of a CSV file with a header."""
    header, rows = read_rows(request.path, (), limits.ROWS, skip_blanks=True)
    return _collect(request, header, [(f"line {line}", row) for line, row in rows])


def read_parquet(request: Request) -> Detections:
    """Boxes of a Parquet file."""
    parquet = load_extra("pyarrow.parquet", "parquet")
    try:
        with parquet.ParquetFile(request.path, memory_map=True) as file:
            header = list(file.schema_arrow.names)
            if file.metadata.num_rows > limits.ROWS:
                raise ValueError(f"{file.metadata.num_rows} rows, more than {limits.ROWS}")
            wanted = sorted(set(known_columns(header, dict(request.source.columns)).values()))
            table = file.read([header[k] for k in wanted])
    except (OSError, ValueError, RuntimeError, load_extra("pyarrow", "parquet").ArrowException) as error:
        raise FormatError(request.path, "", f"no Parquet ({error})"[:100], "a Parquet file") from error
    columns = [column.to_pylist() for column in table.columns]
    rows = [(f"row {k}", row) for k, row in enumerate(zip(*columns, strict=True))]
    return _collect(request, table.column_names, rows)


def is_json_table(data: Any) -> bool:
    """Whether parsed JSON is a list of boxes, each with its frame, as supervision's JSONSink writes them."""
    if not isinstance(data, list) or not data or not isinstance(data[0], dict):
        return False
    at = known_columns([str(name) for name in data[0]], {})
    return "frame" in at and _form(at) is not None


def read_json_table(request: Request, data: Any) -> Detections:
    """Boxes of a list in JSON."""
    header = list(data[0])
    rows = [
        (f"box {k}", [required_value(request.path, f"box {k}", one, name) for name in header])
        for k, one in enumerate(data)
    ]
    return _collect(request, header, rows)


def known_columns(header: Sequence[str], columns: Mapping[str, str]) -> dict[str, int]:
    """Where our columns stand in a header, by the rig's mapping, our names, and the usual other names."""
    lower = [name.lower() for name in header]
    found: dict[str, int] = {}
    for column in COLUMNS:
        for name in [columns[column]] if column in columns else [column, *_SYNONYMS.get(column, ())]:
            if name in header or name.lower() in lower:
                found[column] = header.index(name) if name in header else lower.index(name.lower())
                break
    return found


def _collect(request: Request, header: Sequence[str], rows: Sequence[tuple[str, Sequence[Any]]]) -> Detections:
    at = known_columns(header, dict(request.source.columns))
    for column, name in request.source.columns:
        if column not in at:
            raise FormatError(request.path, f"columns.{column}", f"no column {name}", one_of(name, list(header)))
    form = _form(at)
    if form is None or "frame" not in at:
        raise FormatError(
            request.path,
            "header",
            f"the columns {', '.join(header)}"[:200],
            "frame, left, top, width, height (or right, bottom; or x, y of the middle), or `columns` in the rig",
        )
    found = DetectionList(request.path)
    for place, row in rows:
        if len(row) < len(header):
            raise FormatError(request.path, place, f"{len(row)} fields", f"{len(header)}")
        frame = number(request.path, place, "frame", row[at["frame"]])
        if not float(frame).is_integer():
            raise FormatError(request.path, place, f"frame {frame:g}", "a whole number")
        box = [number(request.path, place, name, row[at[name]]) for name in form]
        if form[2] == "right":
            box[2:] = box[2] - box[0], box[3] - box[1]
        elif form[0] == "x":
            box[:2] = box[0] - box[2] / 2, box[1] - box[3] / 2
        score = row[at["score"]] if "score" in at and row[at["score"]] != "" else 1.0
        found.add(place, int(frame), box, score, str(row[at["class"]]).strip() if "class" in at else "")
    return found.done()


def _form(columns: Mapping[str, int]) -> tuple[str, ...] | None:
    """The four columns of a box among those that are known."""
    return next((form for form in _FORMS if all(name in columns for name in form)), None)


def is_ground_truth(path: Path) -> bool:
    """Whether a text file's first line has nine numbers."""
    try:
        with path.open(encoding="utf-8-sig") as lines:
            fields = lines.readline(limits.LINE).replace(",", " ").split()
    except (OSError, UnicodeDecodeError):
        return False
    return len(fields) == 9 and all(not math.isnan(parse_number(word)) for word in fields)


def read_ground_truth(request: Request) -> Detections:
    """Boxes that the flag includes, with their classes.

    Left and top stay as they stand: the benchmark counts pixels from 1, many programs that write its files from 0, and
    no file says which.
    """
    found = DetectionList(request.path)
    with reading(request.path, "a text file"):
        lines = read_text(request.path, limits.DETECTIONS_FILE).splitlines()
    for row, line in enumerate(lines, 1):
        if not line.strip():
            continue
        place = f"line {row}"
        values = [number(request.path, place, "field", word) for word in line.replace(",", " ").split()]
        _check(request.path, place, values)
        if values[6] != 0:
            kind = int(values[7])
            label = _CLASSES[kind] if 0 < kind < len(_CLASSES) else str(kind)
            found.add(place, int(values[0]), values[2:6], label=label)
    return found.done()


def _check(path: Path, place: str, values: list[float]) -> None:
    if len(values) not in (8, 9):
        raise FormatError(path, place, f"{len(values)} fields", "9, as the first line has")
    for name, value in (("frame", values[0]), ("class", values[7])):
        if not value.is_integer():
            raise FormatError(path, place, f"{name} {value:g}", "a whole number")
