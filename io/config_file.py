"""The configuration: TOML with a table a stage, overridden by assignments from the command line.

The sections are nested frozen dataclasses, read and written whatever their keys. A setting may be a bool, int, float,
str, a Literal of texts, a tuple of those, any of them or None, or a dataclass of settings, which is a table. TOML has
no None: a setting that may be None must have it as its default, and is left out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from textwrap import wrap
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from stseg.config import Config
from stseg.config.keys import describe, is_user_key, values
from stseg.errors import ConfigError, one_of
from stseg.io.toml import parse_toml, toml_value
from stseg.io.untrusted.bounded_files import read_text, reading
from stseg.io.untrusted.values import abbreviated, finite_number

_OPTION = "--set"
_HEAD = """# Configuration of stseg. Lines may be left out: what is not given has its default.
# Checked with every run; `stseg config --expert` prints the constants of the methods as well.

"""
T = TypeVar("T")

_COMMENT = 110
"""Width of a comment, characters."""
_WORDS = {bool: "true or false", int: "a whole number", float: "a finite number", str: "a text"}


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
    if path is None:
        return parse_config("", _OPTION, assignments)
    path = Path(path)
    with reading(path, "a configuration in TOML", ConfigError):
        text = read_text(path)
    return parse_config(text, str(path), assignments)


def parse_config(text: str, place: str, assignments: Sequence[str] = ()) -> Config:
    """The configuration of a TOML text from `place` and assignments; raises as `read_config` does."""
    try:
        given = _wrapped(parse_toml(text), place)
    except ValueError as error:
        raise ConfigError(place, "", f"what is not TOML ({error})", "TOML") from error
    for assignment in assignments:
        _assign(given, assignment)
    return build(Config, given, place)


def describe_config(config: Config, *, expert: bool) -> str:
    """The configuration as TOML with a comment above each key; `read_config` of it gives back the same.

    With `expert`, constants of the methods stand there as well, not only keys for users and values that were changed.
    """
    defaults, given, model = dict(values(Config())), dict(values(config)), config.foreground.model

    def comment(key: str) -> str | None:
        changed = given[key] != defaults[key]
        return describe(key) if expert or changed or is_user_key(key, model) else None

    return _HEAD + as_toml(config, comment=comment)


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


@dataclass(frozen=True, slots=True)
class Given:
    """A value from the user, and the file or option that it stands in."""

    value: object
    place: str


GivenTree = Mapping[str, "Given | GivenTree"]


def build(kind: type[T], given: GivenTree, place: str, table: str = "") -> T:
    """Settings of a kind, a dataclass: what is given, by names and tables of them, and defaults for the rest.

    `place` is named where a fault lies in no single value; `table` is the full name of the table that the settings
    stand in, empty at the top. ConfigError where a name is unknown, a value of another type, or out of the range that
    the dataclass itself holds to.
    """
    hints = get_type_hints(kind)
    values = {}
    for name, entry in given.items():
        key = _join(table, name)
        if name not in hints:
            raise ConfigError(_place(entry, place), key or "''", "an unknown key", one_of(name, hints))
        values[name] = _built(hints[name], entry, place, key)
    try:
        return kind(**values)
    except ConfigError as error:
        key = _join(table, error.key)
        raise ConfigError(_place(given.get(error.key), place), key, error.found, error.expected) from error


def as_toml(settings: Any, table: str = "", comment: Callable[[str], str | None] | None = None) -> str:
    """The TOML text of settings in a table (full name; empty at the top); `build` of it gives back the same.

    `comment` gives the comment above a key, which is given in full; None to leave the key out.
    """
    lines, tables = [], []
    for field in fields(settings):
        value, key = getattr(settings, field.name), _join(table, field.name)
        if is_dataclass(value):
            tables.append(as_toml(value, key, comment))
        elif value is not None:
            above = "" if comment is None else comment(key)
            if above is not None:
                lines += [f"# {line}" for line in wrap(above, _COMMENT)] + [f"{field.name} = {toml_value(value)}"]
    head = [f"[{table}]"] if table else []
    body = ["\n".join([*head, *lines]) + "\n"] if lines else []
    return "\n".join(body + [text for text in tables if text])


def _built(hint: Any, entry: Given | GivenTree, place: str, key: str) -> Any:
    if is_dataclass(hint):
        if isinstance(entry, Given):
            raise ConfigError(entry.place, key, abbreviated(entry.value), "a table")
        return build(cast(type[Any], hint), entry, place, key)
    if not isinstance(entry, Given):
        raise ConfigError(_place(entry, place), key, "a table", _in_words(hint))
    value = _converted(hint, entry.value)
    if value is None:
        raise ConfigError(entry.place, key, abbreviated(entry.value), _in_words(hint))
    return value


def _converted(hint: Any, value: object) -> Any:
    """The value as the type asks for it; None where it does not fit."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return value if value in arguments else None
    if origin in (Union, UnionType):
        fits = (_converted(argument, value) for argument in arguments if argument is not NoneType)
        return next((fit for fit in fits if fit is not None), None)
    if origin is tuple:
        return _converted_items(arguments, value)
    if hint is float and type(value) in (int, float):
        return finite_number(value)
    return value if type(value) is hint else None


def _converted_items(hints: tuple[Any, ...], value: object) -> tuple[Any, ...] | None:
    if not isinstance(value, list):
        return None
    wanted = (hints[0],) * len(value) if hints[-1] is ... else hints
    if len(wanted) != len(value):
        return None
    items = tuple(_converted(hint, item) for hint, item in zip(wanted, value, strict=True))
    return None if None in items else items


def _in_words(hint: Any) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return f"one of {', '.join(map(str, arguments))}"
    if origin in (Union, UnionType):
        return " or ".join(_in_words(argument) for argument in arguments if argument is not NoneType)
    if origin is tuple:
        count = "a list" if arguments[-1] is ... else f"a list of {len(arguments)}"
        return f"{count}, each {_in_words(arguments[0])}"
    return _WORDS[hint]


def _place(entry: Given | GivenTree | None, place: str) -> str:
    """Where something was given; of a table, where its first value was."""
    while isinstance(entry, Mapping):
        entry = next(iter(entry.values()), None)
    return place if entry is None else entry.place


def _join(table: str, name: str) -> str:
    return f"{table}.{name}" if table and name else table or name
