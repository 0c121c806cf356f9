"""Ranges of settings, declared with their fields and checked when settings are made."""

from collections.abc import Callable
from dataclasses import field, fields
from typing import Any

from stseg.errors import ConfigError

LARGEST = 1e9
"""Largest size of a setting, in any unit: seconds of 30 years."""
METRES = 1e3
"""Largest length of a setting, metres, and speed, metres per second."""
COUNT = 1_000
"""Largest number of what is made or repeated so many times, where a setting states no other."""
SEED = 2**63 - 1
"""Largest seed: the largest number of TOML."""


class Settings:
    """Base of the sections of the configuration: each field is held to its range.

    Raises
    ------
    ConfigError
        With the place "configuration"; `stseg.io.config_file.build` puts there where the user wrote it.
    """

    def __post_init__(self) -> None:
        for one in fields(self):  # type: ignore[arg-type]  # sections are dataclasses
            value, most = getattr(self, one.name), one.metadata.get("most", LARGEST)
            if "range" in one.metadata:
                holds, expected = one.metadata["range"]
                require(holds(value), self, one.name, expected)
            if isinstance(value, float | int):
                require(abs(value) <= most, self, one.name, f"at most {most:g}" if value > 0 else f"at least {-most:g}")


def require(holds: bool, settings: object, name: str, expected: str) -> None:
    """Refuse a setting that is out of its range; raises ConfigError."""
    if not holds:
        raise ConfigError("configuration", name, repr(getattr(settings, name)), expected)


def within(default: Any, holds: Callable[[Any], bool], expected: str, most: float = LARGEST) -> Any:
    """A field with a default and a range; numbers are of at most a size."""
    return field(default=default, metadata={"range": (holds, expected), "most": most})


def positive(default: float, expected: str = "a number above 0", most: float = LARGEST) -> Any:
    """A field for numbers above 0."""
    return within(default, lambda value: value > 0, expected, most)


def not_negative(default: float, expected: str = "0 or more", most: float = LARGEST) -> Any:
    """A field for numbers from 0 on."""
    return within(default, lambda value: value >= 0, expected, most)


def at_least(default: int, least: int, most: int = COUNT) -> Any:
    """A field for whole numbers from `least` on."""
    return within(default, lambda value: value >= least, f"{least} or more", most)


def share(default: float) -> Any:
    """A field for numbers between 0 and 1."""
    return within(default, lambda value: 0 < value < 1, "a number between 0 and 1")
