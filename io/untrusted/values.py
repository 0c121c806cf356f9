"""Single values from outside: names checked once for all uses, text that becomes numbers, values as errors show them.

Form, digits, finiteness and range of a number are checked before it is used; a caller names file and key.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from reprlib import Repr
from typing import TypeGuard

import numpy as np

from stseg.errors import ConfigError, FormatError, OutputError
from stseg.io.untrusted import limits

_LONGEST_VALUE = 60
"""Characters of a value in an error."""
_REPR = Repr()
_REPR.maxlevel, _REPR.maxlist, _REPR.maxdict = 2, 8, 4
_REPR.maxstring = _REPR.maxother = _LONGEST_VALUE
_FORBIDDEN, _FORMULA = frozenset("/\\"), "=+-@"
EXPECTED_TITLE = f"a name of 1 to {limits.NAME} printable characters, not {' '.join(_FORMULA)} first"
EXPECTED = f"{EXPECTED_TITLE}, without slashes, that a file can have"
_LONGEST_NUMBER = 400
"""Characters of a number: the longest that Python itself writes has 326."""
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,5})?\s*", re.ASCII)
_WHOLE_NUMBER = re.compile(r"\s*[+-]?\d{1,18}\s*", re.ASCII)


def is_name(text: object) -> TypeGuard[str]:
    """Whether a text can be a title and a file's name."""
    return (
        is_title(text)
        and len(text.encode("utf-8", "replace")) <= limits.PATH_PART - len("_instances.toml")
        and text.strip(".") != ""
        and not _FORBIDDEN & set(text)
    )


def is_title(text: object) -> TypeGuard[str]:
    """Whether a text can name a track, a zone or a line: printable, neither empty nor long, and no formula.

    Control and direction marks are not printable. A spreadsheet runs a cell that begins with = + - or @; a number may.
    """
    return (
        isinstance(text, str)
        and 0 < len(text) <= limits.NAME
        and text.isprintable()
        and text == text.strip()
        and (text[0] not in _FORMULA or math.isfinite(parse_number(text)))
    )


def is_file_name(text: object) -> bool:
    """Whether a text names a file within a folder, and never a place outside of it."""
    return isinstance(text, str) and is_path(text) and "/" not in text and text not in (".", "..")


def is_path(text: str) -> bool:
    """Whether a text can be a path: not too long, and without NUL."""
    data = text.encode("utf-8", "surrogateescape")
    return (
        0 < len(data) <= limits.PATH
        and b"\0" not in data
        and all(len(part) <= limits.PATH_PART for part in data.split(b"/"))
    )


def require_within(option: str, value: float, bounds: tuple[float, float]) -> None:
    """Refuse a number of the command line outside its bounds; raises ConfigError."""
    low, high = bounds
    if not low <= value <= high:
        raise ConfigError("command line", option, repr(value), f"a number from {low:g} to {high:g}")


def require_utf8(path: Path, purpose: str) -> None:
    """Refuse an output at a path that is no UTF-8, where a library cannot write there; raises OutputError."""
    try:
        str(path.absolute()).encode("utf-8")
    except UnicodeEncodeError as error:
        raise OutputError(path, "", "a path that is no UTF-8", f"one that is, for {purpose}") from error


def require_once(path: Path, header: Iterable[str]) -> None:
    """Refuse a table that has two columns of one name; raises FormatError."""
    twice = [name for name, count in Counter(header).items() if name and count > 1]
    if twice:
        raise FormatError(path, "header", f"the column {twice[0][: limits.NAME]} twice", "each once")


def parse_number(text: str) -> float:
    """A finite decimal number from text; nan for anything else.

    Unlike `float`, neither underscores, digits of other scripts, nor words such as `infinity` are numbers.
    """
    if len(text) > _LONGEST_NUMBER or _NUMBER.fullmatch(text) is None:
        return math.nan
    number = float(text)
    return number if math.isfinite(number) else math.nan


def parse_whole(text: str, low: int, high: int) -> int | None:
    """A whole number within [low, high] from text; None for anything else."""
    if _WHOLE_NUMBER.fullmatch(text) is None:
        return None
    number = int(text)
    return number if low <= number <= high else None


def parse_pair(text: str, low: int, high: int) -> tuple[int, int] | None:
    """Two whole numbers within [low, high] from text with a comma between them; None for anything else."""
    one, comma, other = text.partition(",")
    first, second = parse_whole(one, low, high), parse_whole(other, low, high)
    return (first, second) if comma and first is not None and second is not None else None


def parse_numbers(words: Sequence[str], largest: float = limits.NUMBER) -> list[float] | None:
    """Finite numbers no larger than `largest` in size; None where one of them is none."""
    numbers = [parse_number(word) for word in words]
    return numbers if all(abs(number) <= largest for number in numbers) else None


def finite_number(value: object, largest: float = math.inf) -> float | None:
    """A value of TOML, JSON or YAML as a finite float, no larger than `largest` in size; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an int beyond the floats
        return None
    return number if math.isfinite(number) and abs(number) <= largest else None


def abbreviated(value: object) -> str:
    """A value as an error shows it: what Python writes, cut to one line; nested values are never written out."""
    try:
        text = _REPR.repr(value.item() if isinstance(value, np.number) else value)
    except ValueError:  # an int of more digits than Python converts
        return "a number of thousands of digits"
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."
