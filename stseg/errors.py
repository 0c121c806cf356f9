"""Errors, as a tree.

    StsegError
    +-- InputError             what the user can mend: which place, which key, what was found, what was expected
        +-- RigError           the rig file and what it says of cameras
        +-- ConfigError        the configuration and the command line
        +-- CalibrationError   a geometry that cannot be: singular, mirrored, sees nothing
        +-- SourceError        recordings: missing, broken, of unequal length or of the wrong size
        +-- FormatError        the contents of any other file that is read
        +-- OutputError        what is written: exists already, cannot be written, disk full
        +-- WorkerError        a process or machine that works for a run dies again and again

A command turns an `StsegError` into one line on standard error and exit status 2.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST_KEY = 300
"""Characters of a key in an error: some stand in files."""
_LONGEST_NAME = 60
"""Characters of a name that is compared with those known."""
_LONGEST_LIST = 600
"""Characters of a list of names in an error: those of all our own fit."""


def printable(text: str) -> str:
    """A text for the terminal: control characters, and bytes that are no UTF-8, as escapes."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode() for character in text
    )


def one_of(name: object, names: Iterable[str]) -> str:
    """Expectation of an error in place of an unknown name: all names, and the one most like it."""
    names = tuple(names)
    close = get_close_matches(str(name)[:_LONGEST_NAME], names, 1)
    known = ", ".join(names)
    beginning = known if len(known) <= _LONGEST_LIST else f"{known[:_LONGEST_LIST]}..."
    return f"one of {beginning}" + (f"; did you mean {close[0][:_LONGEST_NAME]}?" if close else "")


class StsegError(Exception):
    """Any error that this package raises on purpose."""


class InputError(StsegError):
    """Something that the user can mend.

    Parameters
    ----------
    place
        The file (or the part of the command line) at fault.
    key
        The key, camera, frame or column inside it; empty where the place says it all.
    found, expected
        What stands there and what should.
    """

    def __init__(self, place: object, key: str, found: object, expected: str) -> None:
        self.place, self.key, self.found, self.expected = str(place), key[:_LONGEST_KEY], str(found), expected
        where = f"{self.place}: {self.key}" if key else self.place
        super().__init__(printable(" ".join(f"{where}: found {self.found}, expected {expected}".splitlines())))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str, str]]:
        """So that it comes whole from one process to another."""
        return type(self), (self.place, self.key, self.found, self.expected)


class RigError(InputError):
    """The rig file does not say what it must."""


class ConfigError(InputError):
    """An option or a configuration key is unknown or out of its range."""


class CalibrationError(InputError):
    """A camera's geometry cannot be what it claims."""


class SourceError(InputError):
    """A recording is missing, broken, or does not fit the rig."""


class FormatError(InputError):
    """A file's contents are not what its kind promises."""


class OutputError(InputError):
    """A result cannot be written."""


class WorkerError(InputError):
    """A process or machine that works for a run dies again and again."""
