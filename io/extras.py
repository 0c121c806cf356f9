"""Optional libraries: imported on use, with an error that gives the command to install them."""

from importlib import import_module
from typing import Any

from stseg.errors import ConfigError


def load_extra(library: str, extra: str) -> Any:
    """Import a module of one of the extras in pyproject.toml. ConfigError where it is not installed."""
    try:
        return import_module(library)
    except ImportError as error:
        name = library.partition(".")[0]
        raise ConfigError("Python", name, "no such library", f"it: pip install 'stseg[{extra}]'") from error
