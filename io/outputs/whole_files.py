"""Atomic writing of files: written under a name of their own beside their place, then synced and renamed.

A part is `NAME.<16 hexadecimal digits>.part`, made with exclusive creation: it never is, nor follows, a file that was
there before. Its name is the mark by which the parts of killed runs are known; nothing else is ever deleted.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stseg.errors import OutputError
from stseg.io.untrusted.bounded_files import is_regular

_ABANDONED = 3600.0
"""Time without a change after which an unlocked part belongs to a killed process, seconds."""
_FRAME = re.compile(r"\d{6,}\.png", re.ASCII)
_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)


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
                raise FileExistsError(17, "a file that has appeared meanwhile") from None
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
        _remove_abandoned(path)
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


def clear_frames(folder: Path) -> None:
    """Make a folder for numbered images, without those of an earlier run; raises OSError, also where it is a link."""
    folder.mkdir(parents=True, exist_ok=True)
    if folder.is_symlink():
        raise OSError(errno.ELOOP, f"{folder.name} is a link")
    for file in folder.iterdir():
        if _FRAME.fullmatch(file.name) and is_regular(file):
            file.unlink()


def _remove_abandoned(path: Path) -> None:
    for part in parts_of(path):
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


def write_page(path: Path, page: str, overwrite: bool = True) -> None:
    """Write an HTML page, whole or not at all.

    OutputError where the file exists and is not to be overwritten, or cannot be written.
    """
    write_file(path, page.encode("utf-8"), overwrite)


def write_file(path: Path, data: bytes, overwrite: bool = True) -> None:
    """Write a file's bytes, whole or not at all; see `write_page`."""
    with replacing(path, overwrite) as part:
        part.write_bytes(data)


def make_folder(path: Path) -> None:
    """Make a folder unless it exists; raises OutputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(path, "", error.strerror or error, "a folder, or a place for one") from error
