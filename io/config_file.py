"""The configuration: TOML with a table a stage, overridden by assignments from the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stseg.config import Config
from stseg.config.keys import describe, is_user_key, values
from stseg.errors import ConfigError
from stseg.io.toml.settings import Given, as_toml, build
from stseg.io.toml.text import parse_toml

_OPTION = "--set"
_HEAD = """# Configuration of stseg. Lines may be left out: what is not given has its default.
# Checked with every run; `stseg config --expert` prints the constants of the methods as well.

"""


def read_config(path: Path | None, assignments: Sequence[str] = ()) -> Config:
    """The configuration of a file and assignments, with defaults for the rest.

    Parameters
    ----------
    path
        TOML, one table a stage; None for the defaults.
    assignments
        `section.key=value` each, the value as in TOML; a text needs no quotes. The last assignment of a key counts.

    Raises
    ------
    ConfigError
        Where the file cannot be read, a key is unknown, or a value of the wrong type or out of its range; it names the
        file or --set, and the key.
    """
    given: dict[str, Any] = {} if path is None else _wrapped(_read_toml(Path(path)), str(path))
    for assignment in assignments:
        _assign(given, assignment)
    return build(Config, given, _OPTION if path is None else str(path))


def parse_config(text: str, place: str, assignments: Sequence[str] = ()) -> Config:
    """The configuration of a TOML text from `place` and assignments; raises as `read_config` does."""
    try:
        given = _wrapped(parse_toml(text), place)
    except ValueError as error:
        raise ConfigError(place, "", f"what is not TOML ({error})", "TOML") from error
    for assignment in assignments:
        _assign(given, assignment)
    return build(Config, given, place)


def format_config(config: Config) -> str:
    """The whole configuration as TOML; `read_config` of it gives back the same."""
    return as_toml(config)


def describe_config(config: Config, *, expert: bool) -> str:
    """The configuration as TOML with a comment above each key; `read_config` of it gives back the same.

    Parameters
    ----------
    config
        The values.
    expert
        Whether constants of the methods stand there as well, not only keys for users and values that were changed.
    """
    defaults, given, model = dict(values(Config())), dict(values(config)), config.foreground.model

    def comment(key: str) -> str | None:
        changed = given[key] != defaults[key]
        return describe(key) if expert or changed or is_user_key(key, model) else None

    return _HEAD + as_toml(config, comment=comment)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return parse_toml(path.read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise ConfigError(path, "", error.strerror or error, "a configuration file") from error
    except ValueError as error:
        raise ConfigError(path, "", f"what is not TOML ({error})", "TOML") from error


def _wrapped(table: Mapping[str, Any], place: str) -> dict[str, Any]:
    return {
        name: _wrapped(value, place) if isinstance(value, dict) else Given(value, place)
        for name, value in table.items()
    }


def _assign(given: dict[str, Any], assignment: str) -> None:
    key, equals, text = assignment.partition("=")
    *tables, name = key.strip().split(".")
    if not equals or not tables or not all((*tables, name)):
        raise ConfigError(_OPTION, "", repr(assignment), "section.key=value")
    table = given
    for part in tables:
        if isinstance(table.setdefault(part, {}), Given):  # the file has a value where a table belongs
            table[part] = {}
        table = table[part]
    table[name] = Given(_value(text.strip()), _OPTION)


def _value(text: str) -> Any:
    """A TOML value; any other text is taken literally."""
    try:
        table = parse_toml(f"value = {text}")
    except ValueError:
        return text
    return table["value"] if len(table) == 1 else text
