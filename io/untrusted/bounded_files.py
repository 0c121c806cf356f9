"""Whole files from outside, read within a bound; pipes and devices are refused rather than waited for.

XML is read without document types, so that no entity can be declared and expanded.
"""

import errno
import json
import os
import stat
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stseg.errors import FormatError, InputError
from stseg.io.untrusted import limits


def read_bytes(path: Path, most: int = limits.TEXT_FILE) -> bytes:
    """The bytes of a regular file.

    OSError where it cannot be read or is no regular file; ValueError, of one line, where it is longer than `most`.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
        state = os.fstat(file.fileno())
        _require_file(state)
        data = file.read(min(most, max(state.st_size, limits.LINE)) + 1)  # so much memory is taken at once
    if len(data) > most:
        raise ValueError(f"more than {most} bytes")
    return data


def read_text(path: Path, most: int = limits.TEXT_FILE) -> str:
    """A text in UTF-8, a byte-order mark left out; raises as `read_bytes` does, for other bytes as well."""
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"bytes that are no UTF-8 at {error.start}") from error


@contextmanager
def reading(path: Path, expected: str, kind: type[InputError] = FormatError, key: str = "") -> Iterator[None]:
    """Raise what keeps a file from being read whole as an error of a kind, at a key."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise kind(path, key, getattr(error, "strerror", None) or error, expected) from error


def require_regular(path: Path) -> None:
    """Raise OSError where a path is missing, or no regular file."""
    _require_file(path.stat())


def _require_file(state: os.stat_result) -> None:
    if stat.S_ISDIR(state.st_mode):
        raise IsADirectoryError(errno.EISDIR, "Is a directory")
    if not stat.S_ISREG(state.st_mode):
        raise OSError(errno.EINVAL, "what is no regular file")


def parse_json(text: str | bytes) -> object:
    """A JSON value; ValueError, of one line, for anything else, deep nesting and numbers of thousands of digits."""
    try:
        value: object = json.loads(text)
    except RecursionError as error:
        raise ValueError("brackets nested too deeply") from error
    return value


def is_regular(path: Path) -> bool:
    """Whether a path is a regular file and no link."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except (OSError, ValueError):
        return False


def parse_xml(file: Path, expected: str, most: int = limits.TEXT_FILE) -> ElementTree.Element:
    """The root of an XML file of the kind `expected`, of so many bytes at most.

    FormatError where it cannot be read, is no XML, or declares a document type.
    """
    with reading(file, expected):
        text = read_text(file, most)
    try:
        # Entities are declared in a document type, which no such file has: refusing it leaves nothing to expand.
        # The check is on decoded text and the parser gets that text, so no declared encoding can hide one.
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise FormatError(file, "", "a document type declaration", f"{expected}, which has none")
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise FormatError(file, "", f"what is not XML ({error})", expected) from error
