"""A TOML table read key by key: types, ranges and shapes are checked, unknown keys refused, errors name the key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self, TypeVar

import numpy as np

from stseg.arrays import Floats
from stseg.errors import InputError, RigError
from stseg.io.toml.text import finite_number, one_of, shown

ANY = -1
"""In a shape: any number of rows."""

T = TypeVar("T", bound=str)


@dataclass(frozen=True)
class Table:
    """One table of a TOML file.

    Attributes
    ----------
    file
        The file, for errors.
    place
        Where in the file the table stands (`camera[1] (cam2)`); empty for the file itself.
    values
        The parsed table.
    """

    file: Path
    place: str
    values: Mapping[str, object]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def key(self, name: str) -> str:
        """The key's full name."""
        return f"{self.place}.{name}" if self.place else name

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
        value = self._get(name, "a text")
        if not isinstance(value, str) or not value.strip():
            raise self.error(name, shown(value), "a text")
        return value

    def texts(self, name: str) -> list[str]:
        """A string that is not empty, or a list of such strings."""
        value = self._get(name, "a text or a list of texts")
        values = value if isinstance(value, list) else [value]
        if not values or not all(isinstance(text, str) and text.strip() for text in values):
            raise self.error(name, shown(value), "a text or a list of texts")
        return [str(text) for text in values]

    def choice(self, name: str, choices: Iterable[T]) -> T:
        """One of a few strings."""
        choices = tuple(choices)
        value = self._get(name, f"one of {', '.join(choices)}")
        for choice in choices:
            if value == choice:
                return choice
        raise self.error(name, shown(value), one_of(value, choices))

    def integer(self, name: str, least: int | None = None) -> int:
        """A whole number, at least `least`."""
        expected = "a whole number" if least is None else f"a whole number, at least {least}"
        value = self._get(name, expected)
        if not isinstance(value, int) or isinstance(value, bool) or (least is not None and value < least):
            raise self.error(name, shown(value), expected)
        return value

    def positive(self, name: str) -> float:
        """A finite number above 0."""
        number = float(self.numbers(name))
        if number <= 0:
            raise self.error(name, repr(number), "a number above 0")
        return number

    def numbers(self, name: str, *shape: int) -> Floats:
        """Finite numbers in nested lists of a given shape, float64; no shape is one number, `ANY` any length."""
        expected = _shape_in_words(shape)
        value = self._get(name, expected)
        if not _has_shape(value, shape):
            raise self.error(name, shown(value), expected)
        array = np.array(value, float)
        if not np.isfinite(array).all():
            raise self.error(name, f"{array[~np.isfinite(array)][0]} in it", f"{expected}, all finite")
        return array

    def table(self, name: str) -> Self:
        """The table below this key."""
        value = self._get(name, "a table")
        if not isinstance(value, dict):
            raise self.error(name, shown(value), "a table")
        return type(self)(self.file, self.key(name), value)

    def tables(self, name: str) -> tuple[Self, ...]:
        """The tables of an array of tables, at least one, counted from 0."""
        expected = f"at least one [[{name}]]"
        value = self._get(name, expected)
        if not isinstance(value, list) or not value or not all(isinstance(row, dict) for row in value):
            raise self.error(name, shown(value), expected)
        return tuple(type(self)(self.file, f"{self.key(name)}[{index}]", row) for index, row in enumerate(value))

    def _get(self, name: str, expected: str) -> object:
        if name not in self.values:
            raise self.error(name, "nothing", expected)
        return self.values[name]


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
