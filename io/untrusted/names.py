"""Names checked once for all uses: files, members of archives, HTML and the terminal."""

from __future__ import annotations

from pathlib import Path

from stseg.errors import OutputError
from stseg.io.untrusted import limits

_FORBIDDEN = frozenset("/\\")
EXPECTED = f"a name of 1 to {limits.NAME} printable characters, without slashes, that a file can have"
EXPECTED_TITLE = f"a name of 1 to {limits.NAME} printable characters"


def is_name(text: object) -> bool:
    """Whether a text is printable and can be a file's name; control and direction marks are not printable."""
    return (
        isinstance(text, str)
        and 0 < len(text) <= limits.NAME
        and len(text.encode("utf-8", "replace")) <= limits.PATH_PART - len("_instances.toml")
        and text.isprintable()
        and text == text.strip()
        and text.strip(".") != ""
        and not _FORBIDDEN & set(text)
    )


def is_title(text: object) -> bool:
    """Whether a text can name a track, a zone or a line: printable, and neither empty nor long."""
    return isinstance(text, str) and 0 < len(text) <= limits.NAME and text.isprintable() and text == text.strip()


def is_file_name(text: object) -> bool:
    """Whether a text names a file within a folder, and never a place outside of it."""
    return isinstance(text, str) and is_path(text) and "/" not in text and text not in (".", "..")


def is_path(text: str) -> bool:
    """Whether a text can be a path: not too long, and without NUL."""
    data = text.encode("utf-8", "surrogateescape")
    return (
        0 < len(data) <= limits.PATH
        and b"\0" not in data
        and all(len(part) <= limits.PATH_PART for part in data.split(b"/"))
    )


def require_utf8(path: Path, purpose: str) -> None:
    """Refuse an output at a path that is no UTF-8, where a library cannot write there; raises OutputError."""
    try:
        str(path.absolute()).encode("utf-8")
    except UnicodeEncodeError as error:
        raise OutputError(path, "", "a path that is no UTF-8", f"one that is, for {purpose}") from error


def printable(text: str) -> str:
    """A text for the terminal: control characters, and bytes that are no UTF-8, as escapes."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode() for character in text
    )
