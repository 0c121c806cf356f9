"""Answers and names as CSV: what a person says of a run's identities."""

from dataclasses import dataclass
from pathlib import Path

from stseg.errors import FormatError, one_of
from stseg.io.track_csv import read_rows
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import EXPECTED_TITLE, abbreviated, is_title, parse_whole


@dataclass(frozen=True)
class AnswerRow:
    """A line of an answers file; 0 and "" where it is empty, None for no frame."""

    place: str
    action: str
    track: int
    other: int
    frame: int | None
    name: str


def read_answers(path: Path, actions: tuple[str, ...]) -> list[AnswerRow]:
    """Answers of a CSV file with the columns action, frame, id, other, name, in any order.

    FormatError where the file is none; names the line.
    """
    found = []
    for line, cells in _lines(path, ("action", "id")):
        place = f"{path}: line {line}"
        action = cells.get("action", "")
        if action not in actions:
            raise FormatError(path, f"line {line}", f"action {abbreviated(action)}", one_of(action, actions))
        track, other, frame = (_whole(path, line, name, cells.get(name, "")) for name in ("id", "other", "frame"))
        if track is None:
            raise FormatError(path, f"line {line}", "no id", "the id of a track")
        name = _title(path, line, cells.get("name", "")) if action == "name" else ""
        found.append(AnswerRow(place, action, track, other or 0, frame, name))
    return found


def read_names(path: Path) -> dict[int, str]:
    """Names of tracks of a CSV file with the columns id and name."""
    names: dict[int, str] = {}
    for line, cells in _lines(path, ("id", "name")):
        identity = _whole(path, line, "id", cells.get("id", ""))
        if identity is None:
            raise FormatError(path, f"line {line}", "no id", "id,name")
        if identity in names:
            raise FormatError(path, f"line {line}", f"id {identity} twice", "a name once a track")
        names[identity] = _title(path, line, cells.get("name", ""))
    return names


def _lines(path: Path, needed: tuple[str, ...]) -> list[tuple[int, dict[str, str]]]:
    header, rows = read_rows(path, needed, limits.ROWS, skip_blanks=True)
    return [(line, {k: v.strip() for k, v in zip(header, row, strict=False)}) for line, row in rows]


def _title(path: Path, line: int, text: str) -> str:
    if not is_title(text):
        raise FormatError(path, f"line {line}", f"name {abbreviated(text)}", EXPECTED_TITLE)
    return text


def _whole(path: Path, line: int, name: str, text: str) -> int | None:
    if not text:
        return None
    number = parse_whole(text, 0, limits.FRAMES)
    if number is None:
        raise FormatError(path, f"line {line}", f"{name} {text!r}"[:80], "a whole number")
    return number
