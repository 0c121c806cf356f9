"""TOML texts and single values, read strictly: the part that the rig file and the configuration share."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from reprlib import Repr
from typing import Any

import numpy as np

from stseg.io.untrusted import limits

_SHOWN = 60
_REPR = Repr()
_REPR.maxlevel, _REPR.maxlist, _REPR.maxdict, _REPR.maxstring, _REPR.maxother = 2, 8, 4, _SHOWN, _SHOWN
_DOTTED = re.compile(
    rf"""(?<![\w"'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{limits.DOTTED_KEY}}}""", re.ASCII
)


def parse_toml(text: str) -> dict[str, Any]:
    """The top table of a TOML text.

    Raises
    ------
    ValueError
        Where it is no TOML, too long or nested too deeply; its message is one line.
    """
    if len(text) > limits.TEXT_FILE:
        raise ValueError(f"{len(text)} characters, more than {limits.TEXT_FILE}")
    if _DOTTED.search(text):
        raise ValueError(f"a dotted key of more than {limits.DOTTED_KEY} parts")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("brackets nested too deeply") from error


def toml_string(text: str) -> str:
    """A text as a basic string of TOML."""
    # TOML's basic strings are JSON's, but for the delete character.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def one_of(name: object, names: Iterable[str]) -> str:
    """Expectation of an error in place of an unknown name: all names, and the one most like it."""
    names = tuple(names)
    close = get_close_matches(str(name)[:_SHOWN], names, 1)
    return f"one of {', '.join(names)}" + (f"; did you mean {close[0]}?" if close else "")


def abbreviated(value: object) -> str:
    """A value as an error shows it: what Python writes, cut to one line; nested values are never written out."""
    try:
        text = _REPR.repr(value.item() if isinstance(value, np.number) else value)
    except ValueError:  # an int of more digits than Python converts
        return "a number of thousands of digits"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
