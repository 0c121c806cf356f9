"""Differences between the request of a run and that of the unfinished run that it would go on with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stseg.io.toml.text import abbreviated
from stseg.io.untrusted import limits
from stseg.io.untrusted.names import printable


@dataclass(frozen=True)
class Difference:
    """A difference between two requests.

    Attributes
    ----------
    key
        The differing key.
    now, begun
        Its value in the present request and in that of the unfinished run.
    """

    key: str
    now: str
    begun: str


def differences(now: dict[str, Any], begun: dict[str, Any], prefix: str = "") -> list[Difference]:
    """All differences of two nested tables."""
    found = []
    for key in (*now, *(key for key in begun if key not in now)):
        a, b, name = now.get(key, "nothing"), begun.get(key, "nothing"), f"{prefix}{key}"
        if isinstance(a, dict) and isinstance(b, dict):
            found += differences(a, b, f"{name}.")
        elif a != b:
            found.append(Difference(name, _value(a), _value(b)))
    return found


def _value(value: object) -> str:
    return printable(value[: limits.NAME]) if isinstance(value, str) else abbreviated(value)
