"""Atomic writing of files: written as NAME.part beside their place, then synced and renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stseg.errors import OutputError


def require_new(path: Path, overwrite: bool) -> None:
    """Refuse an output that exists or cannot be made, before any work is done.

    Raises
    ------
    OutputError
    """
    if path.is_dir():
        raise OutputError(path, "", "a folder", "the name of a file")
    if path.exists() and not overwrite:
        raise OutputError(path, "", "a file that exists", "a new name, or --overwrite")
    if not path.parent.is_dir():
        raise OutputError(path, "", "no such folder", "a name in a folder that exists")


def part_path(path: Path) -> Path:
    """The temporary name of a file that is being written."""
    return path.with_name(f"{path.name}.part")


def publish_part(path: Path) -> None:
    """Rename the finished part of `path` to its name, and sync the folder."""
    part_path(path).replace(path)
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

    Raises
    ------
    OutputError
        Where the file exists and is not to be overwritten, or cannot be written.
    """
    require_new(path, overwrite)
    part = part_path(path)
    try:
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        publish_part(path)
    except OutputError as error:
        raise OutputError(path, error.key, error.found, error.expected) from error
    except OSError as error:
        raise output_error(path, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def output_error(path: Path, error: OSError) -> OutputError:
    """The error for a refusal of the operating system to write."""
    if isinstance(error, BlockingIOError):
        return OutputError(path, "", "a file that another run is writing", "a name of its own for each run")
    return OutputError(path, "", error.strerror or error, "a place with room that can be written")
