"""Ranges of settings, declared with their fields and checked when settings are made."""

from collections.abc import Callable
from dataclasses import field, fields
from typing import Any

from stseg.errors import ConfigError


class Settings:
    """Base of the sections of the configuration: each field is held to its range.

    Raises
    ------
    ConfigError
        With the place "configuration"; `stseg.io.config_file.build` puts there where the user wrote it.
    """

    def __post_init__(self) -> None:
        for one in fields(self):  # type: ignore[arg-type]  # sections are dataclasses
            if "range" in one.metadata:
                holds, expected = one.metadata["range"]
                require(holds(getattr(self, one.name)), self, one.name, expected)


def require(holds: bool, settings: object, name: str, expected: str) -> None:
    """Refuse a setting that is out of its range; raises ConfigError."""
    if not holds:
        raise ConfigError("configuration", name, repr(getattr(settings, name)), expected)


def within(default: Any, holds: Callable[[Any], bool], expected: str) -> Any:
    """A field with a default and a range."""
    return field(default=default, metadata={"range": (holds, expected)})


def positive(default: float, expected: str = "a number above 0") -> Any:
    """A field for numbers above 0."""
    return within(default, lambda value: value > 0, expected)


def not_negative(default: float, expected: str = "0 or more") -> Any:
    """A field for numbers from 0 on."""
    return within(default, lambda value: value >= 0, expected)


def at_least(default: int, least: int) -> Any:
    """A field for whole numbers from `least` on."""
    return within(default, lambda value: value >= least, f"{least} or more")


def share(default: float) -> Any:
    """A field for numbers between 0 and 1."""
    return within(default, lambda value: 0 < value < 1, "a number between 0 and 1")
