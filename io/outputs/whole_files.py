"""Atomic writing of files: written under a name of their own beside their place, then synced and renamed.

A part is `NAME.<16 hexadecimal digits>.part`, made with exclusive creation: it never is, nor follows, a file that was
there before. Its name is the mark by which the parts of killed runs are known; nothing else is ever deleted.

A file is replaced only where it carries our mark, and is none that the same command reads.
"""

import errno
import os
import re
import secrets
import time
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from itertools import chain
from pathlib import Path

from stseg.errors import OutputError
from stseg.io.untrusted.bounded_files import is_regular

_ABANDONED = 3600.0
"""Time without a change after which an unlocked part belongs to a killed process, seconds."""
_FRAME = re.compile(r"\d{6,}\.png", re.ASCII)
_FRAME_PART = re.compile(rf"{_FRAME.pattern}\.[0-9a-f]{{16}}\.part", re.ASCII)
_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
MARK = b"made by stseg"
"""In every file of ours whose format has room for it."""
_OURS = re.compile(rb"made by stseg|stseg-run")
"""The mark, or the format of run files."""
_SEARCHED = 1 << 22
"""Bytes at the beginning and at the end of a file in which the mark is looked for."""


class Inputs:
    """Files that a command reads, known by device and inode when they are first asked for."""

    def __init__(self, *paths: Iterable[Path | None]) -> None:
        self._paths = chain.from_iterable(paths)

    def __contains__(self, path: Path) -> bool:
        identity = _identity(path)
        return identity is not None and identity in self._identities

    @cached_property
    def _identities(self) -> frozenset[tuple[int, int] | None]:
        return frozenset(_identity(path) for path in self._paths if path is not None) - {None}


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of what a path leads to; None for nothing."""
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None
    return state.st_dev, state.st_ino


NO_INPUTS = Inputs()


def require_output(path: Path, overwrite: bool, inputs: Inputs = NO_INPUTS, table: str = "") -> None:
    """Refuse an output as `require_new` does, and an older file that is an input or that stseg did not make.

    `table` is a regular expression of the beginnings of text tables, whose formats have no room for the mark.
    """
    require_new(path, overwrite)
    try:
        if path in inputs:
            raise OutputError(path, "", "a file that is read here", "another file: what is read is not replaced")
        if os.path.lexists(path) and not _is_ours(path, table):
            raise OutputError(path, "", "a file that stseg did not make", "a new name; --overwrite leaves it alone")
    except OSError as error:
        raise output_error(path, error) from error


def _is_ours(path: Path, table: str = "") -> bool:
    """Whether a file is regular, and empty, marked, or a table that begins so."""
    if not is_regular(path):
        return False
    with path.open("rb") as file:
        beginning, size = file.read(_SEARCHED), path.stat().st_size
        if not beginning or _OURS.search(beginning) or (table and re.match(table.encode(), beginning)):
            return True
        file.seek(max(0, size - _SEARCHED))
        return _OURS.search(file.read(_SEARCHED)) is not None


def marked_png(png: bytes) -> bytes:
    """A PNG file's bytes with the mark as a text behind the header."""
    text = b"tEXtSoftware\0" + MARK
    return png[:33] + (len(text) - 4).to_bytes(4) + text + zlib.crc32(text).to_bytes(4) + png[33:]


def write_png(path: Path, png: bytes, overwrite: bool, inputs: Inputs) -> None:
    """Write a PNG file's bytes with the mark; raises OutputError, see `require_output`."""
    require_output(path, overwrite, inputs)
    write_file(path, marked_png(png), overwrite)


def require_new(path: Path, overwrite: bool) -> None:
    """Refuse an output that exists or cannot be made, before any work is done; raises OutputError."""
    try:
        if path.is_dir():
            raise OutputError(path, "", "a folder", "the name of a file")
        if os.path.lexists(path) and not overwrite:
            raise OutputError(path, "", "a file that exists", "a new name, or --overwrite")
        if not path.parent.is_dir():
            raise OutputError(path, "", "no such folder", "a name in a folder that exists")
    except ValueError as error:  # a NUL in it
        raise OutputError(path, "", str(error), "the name of a file") from error


def create_part(path: Path) -> tuple[Path, int]:
    """A new, empty part of `path` and its descriptor, open for reading and writing; raises OSError."""
    part = path.with_name(f"{path.name}.{secrets.token_hex(8)}.part")
    try:
        return part, os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL | _NO_FOLLOW | getattr(os, "O_BINARY", 0), 0o666)
    except KeyboardInterrupt:  # it may have come when the file was made
        part.unlink(missing_ok=True)
        raise


def parts_of(path: Path) -> list[Path]:
    """All parts of `path`: regular files of that name pattern, no links."""
    name = re.compile(rf"{re.escape(path.name)}\.[0-9a-f]{{16}}\.part")
    return [file for file in path.parent.iterdir() if name.fullmatch(file.name) and is_regular(file)]


def publish_part(part: Path, path: Path, overwrite: bool) -> None:
    """Give a finished, synced part its name, and sync the folder.

    Raises
    ------
    FileExistsError
        Where a file has appeared there meanwhile and is not to be overwritten.
    OSError
    """
    if overwrite:
        part.replace(path)
    else:
        try:
            os.link(part, path)  # unlike a rename, it never replaces a file
        except FileExistsError:
            raise
        except OSError:  # a file system without links
            if os.path.lexists(path):
                raise FileExistsError(errno.EEXIST, "a file that has appeared meanwhile") from None
            part.replace(path)
        else:
            part.unlink()
    sync_folder(path.parent)


def sync_folder(path: Path) -> None:
    """Make new names in a folder durable."""
    with suppress(OSError):  # some systems cannot open folders; the file itself is safe
        folder = os.open(path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextmanager
def replacing(path: Path, overwrite: bool) -> Iterator[Path]:
    """A temporary path to write to, renamed to `path` at the end unless an exception was raised.

    OutputError where the file exists and is not to be overwritten, or cannot be written.
    """
    require_new(path, overwrite)
    part: Path | None = None
    try:
        _remove_abandoned(parts_of(path))
        part, descriptor = create_part(path)
        os.close(descriptor)
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        publish_part(part, path, overwrite)
    except OutputError as error:
        raise OutputError(path, error.key, error.found, error.expected) from error
    except OSError as error:
        raise output_error(path, error) from error
    finally:
        if part is not None:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_quickly(path: Path, data: bytes) -> None:
    """Replace a small file atomically, without waiting for the disk; raises OSError."""
    part, descriptor = create_part(path)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        part.replace(path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def require_own_frames(folder: Path, inputs: Inputs) -> list[Path]:
    """The numbered images in a folder, all ours; OutputError where one is not, or is read by the same command."""
    if folder.is_symlink():
        raise OSError(errno.ELOOP, f"{folder.name} is a link")
    frames = [file for file in folder.iterdir() if _FRAME.fullmatch(file.name)] if folder.is_dir() else []
    for file in frames:
        require_output(file, True, inputs)
    return frames


def clear_frames(folder: Path, inputs: Inputs = NO_INPUTS) -> None:
    """Make a folder for numbered images, without those of an earlier run; raises OSError, also where it is a link."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in require_own_frames(folder, inputs):
        file.unlink()
    _remove_abandoned(file for file in folder.glob("*.part") if _FRAME_PART.fullmatch(file.name) and is_regular(file))


def _remove_abandoned(parts: Iterable[Path]) -> None:
    for part in parts:
        with suppress(OSError):
            if abs(time.time() - part.stat().st_mtime) > _ABANDONED:  # a clock may have been set back meanwhile
                part.unlink()


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Raise the operating system's refusals to write as OutputError, which names the path."""
    try:
        yield
    except OSError as error:
        raise output_error(path, error) from error


def output_error(path: Path, error: OSError) -> OutputError:
    """The error for a refusal of the operating system to write."""
    if isinstance(error, BlockingIOError):
        return OutputError(path, "", "a file that another run is writing", "a name of its own for each run")
    if isinstance(error, FileExistsError):
        return OutputError(path, "", "a file that has appeared meanwhile", "none, or --overwrite")
    return OutputError(path, "", error.strerror or error, "a place with room that can be written")


def write_file(path: Path, data: bytes, overwrite: bool = True) -> None:
    """Write a file's bytes, whole or not at all.

    OutputError where the file exists and is not to be overwritten, or cannot be written.
    """
    with replacing(path, overwrite) as part:
        part.write_bytes(data)


def require_empty(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds something, unless that may be overwritten, before any work; raises OutputError."""
    with output_errors(folder):
        if folder.exists() and any(folder.iterdir()) and not overwrite:
            raise OutputError(folder, "", "files in it", "an empty folder, a new name, or --overwrite")


def make_folder(path: Path) -> None:
    """Make a folder unless it exists; raises OutputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(path, "", error.strerror or error, "a folder, or a place for one") from error
