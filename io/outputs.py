"""Files that appear whole or not at all: written beside their place as NAME.part, then synced and renamed."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from stseg.errors import OutputError

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows has no such locks: two runs into one file go unnoticed there

    def _lock(file: BinaryIO) -> None:
        pass
else:

    def _lock(file: BinaryIO) -> None:
        try:
            flock(file, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            pass  # a file system without locks


def require_new(path: Path, overwrite: bool) -> None:
    """Refuse an output that exists, or that cannot stand at its place, before any work is done.

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


def part_of(path: Path) -> Path:
    """Where a file stands until it is whole."""
    return path.with_name(f"{path.name}.part")


def publish(path: Path) -> None:
    """Rename the part of `path`, whole and synced, to its name, and sync the folder."""
    part_of(path).replace(path)
    with suppress(OSError):  # some systems cannot open folders; the file itself is safe
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextmanager
def replacing(path: Path, overwrite: bool) -> Iterator[Path]:
    """A temporary path to write to, which takes the name `path` at the end unless something was raised.

    Raises
    ------
    OutputError
        Where the file exists and is not to be overwritten, or cannot be written.
    """
    require_new(path, overwrite)
    part = part_of(path)
    try:
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        publish(path)
    except OutputError as error:
        raise OutputError(path, error.key, error.found, error.expected) from error
    except OSError as error:
        raise failure(path, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def failure(path: Path, error: OSError) -> OutputError:
    """What the user is told when the system refuses to write."""
    if isinstance(error, BlockingIOError):
        return OutputError(path, "", "a file that another run is writing", "a name of its own for each run")
    return OutputError(path, "", error.strerror or error, "a place with room that can be written")


class PartFile(io.RawIOBase):
    """The part of an output, as a file object that never fails before its user's eyes.

    HDF5 cannot close a file once a write has failed (and may crash on trying), so it is told of no failure: the first
    one is kept, later writes are dropped, and the writer asks `check` after each step.

    Parameters
    ----------
    path
        The output whose part this is. An old part is overwritten, unless another process holds it open.

    Raises
    ------
    OutputError
        Where the part cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failure: OSError | None = None
        try:
            self._file = os.fdopen(os.open(part_of(path), os.O_RDWR | os.O_CREAT, 0o666), "r+b", buffering=0)
        except OSError as error:
            raise failure(path, error) from error
        try:
            _lock(self._file)
            self._file.truncate(0)
        except OSError as error:
            self._file.close()
            raise failure(path, error) from error

    def check(self) -> None:
        """Raise OutputError where a write has failed."""
        if self._failure is not None:
            raise failure(self._path, self._failure) from self._failure

    def publish(self, overwrite: bool) -> None:
        """Sync, and give the file its name; where that fails the part stays, for it is whole."""
        kept = f"the whole result is kept in {part_of(self._path)}"
        if self._path.exists() and not overwrite:
            raise OutputError(self._path, "", "a file that has appeared meanwhile", f"none; {kept}")
        try:
            os.fsync(self._file.fileno())
            if os.name == "nt":  # cannot rename what is open; elsewhere the lock is held until the name is taken
                self._file.close()
            publish(self._path)
        except OSError as error:
            told = failure(self._path, error)
            raise OutputError(told.place, "", told.found, f"{told.expected}; {kept}") from error

    def discard(self) -> None:
        """Delete the part."""
        with suppress(OSError):
            part_of(self._path).unlink(missing_ok=True)

    def close(self) -> None:
        """Let go of the file and its lock; nothing is left to be written by then."""
        if not self.closed:
            with suppress(OSError):
                self._file.close()
        super().close()

    def write(self, data: memoryview) -> int:  # type: ignore[override]  # what h5py gives
        """All of it, or a failure is kept."""
        rest = memoryview(data)
        try:
            while self._failure is None and rest.nbytes:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self._failure = error
        return memoryview(data).nbytes

    def truncate(self, size: int | None = None) -> int:
        """Set the length."""
        try:
            if self._failure is None:
                self._file.truncate(size)
        except OSError as error:
            self._failure = error
        return size or 0

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # what h5py gives
        """As of any file."""
        return self._file.readinto(buffer) or 0

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of any file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As of any file."""
        return self._file.tell()

    def flush(self) -> None:
        """Nothing is buffered here."""
