"""TOML texts and single values, read strictly: the part that the rig file and the configuration share."""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

from stseg.io.untrusted import limits

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


def toml_value(value: Any) -> str:
    """A value as TOML: truths, numbers, texts, lists or tuples of them, and tables of one line."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{toml_string(name)} = {toml_value(one)}' for name, one in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, str):
        return toml_string(value)
    return repr(value).lower() if isinstance(value, bool) else repr(value)
