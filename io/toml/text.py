"""TOML texts and single values, read strictly: the part that the rig file and the configuration share."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

LONGEST_TEXT = 1 << 24
"""Characters of a TOML file; a rig of a thousand cameras has a million."""
DEEPEST_KEY = 32
"""Parts of a dotted key: tomllib needs a time that grows with the square of their number."""
_SHOWN = 60
_DOTTED = re.compile(
    rf"""(?<![\w"'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{DEEPEST_KEY}}}""", re.ASCII
)


def parse_toml(text: str) -> dict[str, Any]:
    """The top table of a TOML text.

    Raises
    ------
    ValueError
        Where it is no TOML, too long or nested too deeply; its message is one line.
    """
    if len(text) > LONGEST_TEXT:
        raise ValueError(f"{len(text)} characters, more than {LONGEST_TEXT}")
    if _DOTTED.search(text):
        raise ValueError(f"a dotted key of more than {DEEPEST_KEY} parts")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("brackets nested too deeply") from error


def toml_string(text: str) -> str:
    """A text as a basic string of TOML."""
    # TOML's basic strings are JSON's, but for the delete character.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def finite_number(value: object) -> float | None:
    """An int or a float as a finite float; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an int beyond the floats
        return None
    return number if math.isfinite(number) else None


def one_of(name: object, names: Iterable[str]) -> str:
    """What an error expects in place of an unknown name: the known ones, and the one most like it."""
    names = tuple(names)
    close = get_close_matches(str(name)[:_SHOWN], names, 1)
    return f"one of {', '.join(names)}" + (f"; did you mean {close[0]}?" if close else "")


def shown(value: object) -> str:
    """A value as an error shows it: what Python writes, cut to one line."""
    try:
        text = repr(value)
    except ValueError:  # an int of more digits than Python converts
        return "a number of thousands of digits"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
