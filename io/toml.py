"""TOML read strictly: types, ranges and shapes are checked, unknown keys refused, errors name the key."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np

from stseg.arrays import Floats
from stseg.errors import InputError, RigError, one_of
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import EXPECTED, abbreviated, finite_number, is_name, is_path

ANY = -1
"""In a shape: any number of rows."""

T = TypeVar("T", bound=str)
_DOTTED = re.compile(
    rf"""(?<![\w"'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{limits.DOTTED_KEY}}}""", re.ASCII
)


@dataclass(frozen=True)
class Table:
    """One table of a TOML file."""

    file: Path
    """The file, for errors."""
    place: str
    """Where in the file the table stands (`camera[1] (cam2)`); empty for the file itself."""
    values: Mapping[str, object]
    """The parsed table."""

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def key(self, name: str) -> str:
        """The key's full name."""
        return f"{self.place}.{name}" if self.place else name or "''"

    def error(self, name: str, found: object, expected: str) -> InputError:
        """An error at the key `name`."""
        return RigError(self.file, self.key(name), found, expected)

    def allow(self, *names: str) -> None:
        """Refuse every other key; the error suggests the most similar name."""
        for name in self.values:
            if name not in names:
                raise self.error(name, "an unknown key", one_of(name, names))

    def text(self, name: str) -> str:
        """A string that is not empty."""
        return str(self._checked(name, "a text", _is_text))

    def name(self, name: str) -> str:
        """The name of a camera or scene, see `stseg.io.untrusted.values`."""
        value = self.text(name)
        if not is_name(value):
            raise self.error(name, abbreviated(value), EXPECTED)
        return value

    def paths(self) -> list[str]:
        """Paths or addresses of the key `path`: a text or a list of texts."""
        values = self.texts("path")
        for value in values:
            if not is_path(value):
                raise self.error("path", abbreviated(value), "a path that a file system takes")
        return values

    def texts(self, name: str) -> list[str]:
        """A string that is not empty, or a list of such strings."""
        value = self._checked(
            name,
            "a text or a list of texts",
            lambda value: _is_text(value) or (isinstance(value, list) and len(value) > 0 and all(map(_is_text, value))),
        )
        return value if isinstance(value, list) else [value]

    def choice(self, name: str, choices: Iterable[T]) -> T:
        """One of a few strings."""
        choices = tuple(choices)
        value = self._get(name, f"one of {', '.join(choices)}")
        for choice in choices:
            if value == choice:
                return choice
        raise self.error(name, abbreviated(value), one_of(value, choices))

    def integer(self, name: str, low: int, high: int) -> int:
        """A whole number within [low, high]."""
        expected = f"a whole number from {low} to {high}"
        value = self._checked(name, expected, lambda value: type(value) is int and low <= value <= high)
        return int(value)

    def require(self, name: str, value: object, expected: str) -> None:
        """One value alone, of its own type."""
        self._checked(name, expected, lambda found: type(found) is type(value) and found == value)

    def truth(self, name: str) -> bool:
        """True or false."""
        return bool(self._checked(name, "true or false", lambda value: isinstance(value, bool)))

    def within(self, name: str, bounds: tuple[float, float]) -> float:
        """A finite number within bounds."""
        number = float(self.numbers(name, largest=np.inf))
        if not bounds[0] <= number <= bounds[1]:
            raise self.error(name, repr(number), f"a number from {bounds[0]:g} to {bounds[1]:g}")
        return number

    def numbers(self, name: str, *shape: int, largest: float = limits.NUMBER) -> Floats:
        """Finite numbers in nested lists of a given shape, float64; no shape is one number, `ANY` any length.

        None of them may be larger than `largest` in size.
        """
        expected = _shape_in_words(shape)
        value = self._checked(name, expected, lambda value: _has_shape(value, shape))
        array = np.array(value, float)
        wrong = ~(np.abs(array) <= largest) | ~np.isfinite(array)
        if wrong.any():
            bound = "" if np.isinf(largest) else f" and at most {largest:g} in size"
            raise self.error(name, f"{array[wrong][0]} in it", f"{expected}, all finite{bound}")
        return array

    def image_size(self, name: str) -> tuple[int, int]:
        """Width and height of an image, pixels."""
        size = self.numbers(name, 2)
        if (size != size.round()).any() or (size < 1).any() or size.max() > limits.SIDE or size.prod() > limits.PIXELS:
            expected = f"width and height in whole pixels, at most {limits.SIDE} each and {limits.PIXELS} pixels"
            raise self.error(name, size.tolist(), expected)
        return int(size[0]), int(size[1])

    def table(self, name: str) -> Self:
        """The table below this key."""
        value = self._checked(name, "a table", lambda value: isinstance(value, dict))
        return type(self)(self.file, self.key(name), value)

    def tables(self, name: str, most: int) -> tuple[Self, ...]:
        """The tables of an array of tables, one to `most`, counted from 0."""
        expected = f"one [[{name}]] or more"
        value = self._checked(name, expected, _is_list_of_tables)
        if len(value) > most:
            raise self.error(name, f"{len(value)} of them", f"at most {most}")
        return tuple(type(self)(self.file, f"{self.key(name)}[{index}]", row) for index, row in enumerate(value))

    def _checked(self, name: str, expected: str, holds: Callable[[Any], bool]) -> Any:
        """The value of a key, for which something holds."""
        value = self._get(name, expected)
        if not holds(value):
            raise self.error(name, abbreviated(value), expected)
        return value

    def _get(self, name: str, expected: str) -> object:
        if name not in self.values:
            raise self.error(name, "nothing", expected)
        return self.values[name]


def _is_text(value: object) -> bool:
    return isinstance(value, str) and value.strip() != ""


def _is_list_of_tables(value: object) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(isinstance(row, dict) for row in value)


def _has_shape(value: object, shape: tuple[int, ...]) -> bool:
    if not shape:  # nan and inf are told apart by the caller, who names them
        return isinstance(value, float) or finite_number(value) is not None
    if not isinstance(value, list) or (shape[0] != ANY and len(value) != shape[0]):
        return False
    return all(_has_shape(row, shape[1:]) for row in value)


def _shape_in_words(shape: tuple[int, ...]) -> str:
    if not shape:
        return "a number"
    if len(shape) == 1:
        return "numbers" if shape[0] == ANY else f"{shape[0]} numbers"
    rows = "rows" if shape[0] == ANY else f"{shape[0]} rows"
    return f"{rows} of {_shape_in_words(shape[1:])}"


def parse_toml(text: str) -> dict[str, Any]:
    """The top table of a TOML text.

    ValueError where it is no TOML, too long or nested too deeply; its message is one line.
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
