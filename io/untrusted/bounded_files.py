"""Whole files from outside, read within a bound; pipes and devices are refused rather than waited for.

XML is read without document types, so that no entity can be declared and expanded.
"""

import json
import os
import stat
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from stseg.errors import FormatError
from stseg.io.untrusted import limits


def read_bytes(path: Path, most: int = limits.TEXT_FILE) -> bytes:
    """The bytes of a regular file.

    OSError where it cannot be read; ValueError where it is no regular file, or longer than `most`; the message is one
    line.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
        state = os.fstat(file.fileno())
        if not stat.S_ISREG(state.st_mode):
            raise ValueError("what is no regular file")
        data = file.read(min(most, max(state.st_size, limits.LINE)) + 1)  # so much memory is taken at once
    if len(data) > most:
        raise ValueError(f"more than {most} bytes")
    return data


def read_text(path: Path, most: int = limits.TEXT_FILE) -> str:
    """A text in UTF-8, a byte-order mark left out; raises as `read_bytes` does, and UnicodeDecodeError."""
    return read_bytes(path, most).decode("utf-8-sig")


def require_regular(path: Path) -> None:
    """Raise OSError where a path is missing or a folder, and ValueError where it is neither file nor folder."""
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(21, "Is a directory")
    if not stat.S_ISREG(mode):
        raise ValueError("what is no regular file")


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


def parse_xml(file: Path, expected: str) -> ElementTree.Element:
    """The root of an XML file of the kind `expected`.

    FormatError where it cannot be read, is no XML, or declares a document type.
    """
    try:
        text = read_text(file)
        # Entities are declared in a document type, which no calibration has: refusing it leaves nothing to expand.
        # The check is on decoded text and the parser gets that text, so no declared encoding can hide one.
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise FormatError(file, "", "a document type declaration", f"{expected}, which has none")
        return ElementTree.fromstring(text)
    except OSError as error:
        raise FormatError(file, "", error.strerror or error, "a calibration file") from error
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise FormatError(file, "", f"what is not XML ({error})", expected) from error
