"""MOTChallenge ground truth (`gt.txt`): lines of nine numbers, with a flag, a class and a visibility."""

from __future__ import annotations

import math
from pathlib import Path

from stseg.errors import FormatError
from stseg.io.detections.record import DetectionList, Detections, Request, number
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import read_text
from stseg.io.untrusted.numbers import parse_number

_CLASSES = (
    *("", "pedestrian", "person on vehicle", "car", "bicycle", "motorbike", "vehicle", "static person", "distractor"),
    *("occluder", "occluder on the ground", "occluder full", "reflection"),
)
"""By number, from MOT16 on (Milan et al., MOT16: a benchmark for multi-object tracking, 2016)."""


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
    for row, line in enumerate(read_text(request.path, limits.DETECTIONS_FILE).splitlines(), 1):
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
