"""JSON and JSON lines, and keys that must be there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from stseg.errors import FormatError, SourceError
from stseg.io.untrusted import limits
from stseg.io.untrusted.bounded_files import parse_json, read_text


def read_json(path: Path) -> Any:
    """Parsed JSON; of JSON lines, the list of the lines.

    Raises
    ------
    SourceError, FormatError
        Where the file cannot be read, or is no JSON: names the line.
    """
    try:
        text = read_text(path, limits.DETECTIONS_FILE)
    except OSError as error:
        raise SourceError(path, "", error.strerror or error, "a file of detections") from error
    except UnicodeDecodeError as error:
        raise FormatError(path, "", "bytes that are no text", "JSON in UTF-8") from error
    except ValueError as error:
        raise FormatError(path, "", error, "a file of detections") from error
    try:
        return parse_json(text)
    except ValueError as whole:
        lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
        if len(lines) < 2 or not _is_json(lines[0][1]):
            place = f"line {whole.lineno}" if isinstance(whole, json.JSONDecodeError) else ""
            raise FormatError(path, place, f"no JSON ({whole})"[:100], "JSON") from whole
    return [_line(path, number, line) for number, line in lines]


def _line(path: Path, number: int, line: str) -> Any:
    try:
        return parse_json(line)
    except ValueError as error:
        raise FormatError(path, f"line {number}", f"no JSON ({error})"[:100], "JSON, one value a line") from error


def _is_json(text: str) -> bool:
    try:
        parse_json(text)
    except ValueError:
        return False
    return True


def require(path: Path, place: str, values: Any, key: str) -> Any:
    """The value of a key; FormatError where it is missing."""
    if not isinstance(values, dict) or key not in values:
        raise FormatError(path, place, f"no {key}", f"the key {key}")
    return values[key]
