"""Libraries that only some need: imported where they are used, and asked for in words where they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from stseg.errors import ConfigError


def load_extra(library: str, extra: str) -> Any:
    """A module of one of the extras in pyproject.toml.

    Raises
    ------
    ConfigError
        Where it is not installed; it gives the command that installs it.
    """
    try:
        return import_module(library)
    except ImportError as error:
        name = library.partition(".")[0]
        raise ConfigError("Python", name, "no such library", f"it: pip install 'stseg[{extra}]'") from error
