"""The file object that HDF5 writes to: failures and interrupts are deferred until HDF5 has returned."""

import io
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import IO, BinaryIO, TypeVar

from stseg.errors import OutputError
from stseg.io.outputs.whole_files import create_part, output_error, parts_of, publish_part

_Handler = Callable[[int, FrameType | None], object]
F = TypeVar("F", bound=IO[bytes] | io.FileIO)


class PartFile(io.RawIOBase):
    """A part of an output as a file object that never raises while HDF5 calls it.

    HDF5 cannot close a file once a write has failed, and crashes on trying. So the first failure is recorded, what is
    not written is kept in memory, where HDF5 reads it back, and both failures and interrupts (Ctrl-C) are raised at the
    end of the step. All calls of HDF5, closing of datasets included, belong into a `step`.

    OutputError where the part cannot be made, or another process writes one.

    Parameters
    ----------
    path
        The output whose part this is. Parts of killed processes are deleted.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failure: OSError | None = None
        self._unwritten: list[tuple[int, bytes]] = []
        self._interrupted: int | None = None
        self._in_step = True  # until the end of the first step: nobody would delete the part before
        self._handlers = self._shield()
        try:
            self._file = self._create()
        except OSError as error:
            self._restore_handlers()
            raise output_error(path, error) from error

    @contextmanager
    def step(self) -> Iterator[None]:
        """A block of HDF5 calls; at its end a deferred failure is raised as OutputError, or a deferred interrupt."""
        self._in_step = True
        try:
            yield
        except (OSError, RuntimeError):  # HDF5 after a failure
            self._raise_failure()
            raise
        finally:
            self._in_step = False
        self._raise_failure()
        if self._interrupted is not None:
            number, self._interrupted = self._interrupted, None
            self._handlers[number](number, None)

    def publish(self, overwrite: bool) -> None:
        """Sync the finished part and rename it; where that fails the part is kept."""
        kept = f"the whole result is kept in {self.part}"
        try:
            os.fsync(self._file.fileno())
            if os.name == "nt":  # cannot rename what is open; elsewhere the lock is held until the name is taken
                self._file.close()
            publish_part(self.part, self._path, overwrite)
        except OSError as error:
            cause = output_error(self._path, error)
            raise OutputError(cause.place, "", cause.found, f"{cause.expected}; {kept}") from error

    def discard(self, close_hdf5: Callable[[], object]) -> None:
        """Delete the part; errors on the way are suppressed in favour of the one that stopped the run."""
        self._in_step = True
        with suppress(OSError, RuntimeError):
            close_hdf5()
        with suppress(OSError):
            self.part.unlink(missing_ok=True)
        self.close()

    def close(self) -> None:
        """Close the file and its lock, after HDF5 has closed it."""
        if self.closed:
            return
        with suppress(OSError):
            self._file.close()
        super().close()
        self._restore_handlers()

    def write(self, data: memoryview) -> int:  # type: ignore[override]  # what h5py gives
        """Write everything; what cannot be written is kept, and the failure recorded."""
        rest = memoryview(data)
        try:
            while self._failure is None and rest.nbytes:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self._failure = error
        if rest.nbytes:
            self._unwritten.append((self._file.tell(), bytes(rest)))
        return memoryview(data).nbytes

    def truncate(self, size: int | None = None) -> int:
        """Set the length, or record the failure."""
        try:
            if self._failure is None:
                self._file.truncate(size)
        except OSError as error:
            self._failure = error
        return size or 0

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # what h5py gives
        """Fill the whole buffer: HDF5 takes what is left of it for a part of the file. Zeros beyond the end."""
        whole, start = memoryview(buffer).cast("B"), self._file.tell()
        read = 0
        while read < whole.nbytes and (more := self._file.readinto(whole[read:])):
            read += more
        whole[read:] = bytes(whole.nbytes - read)
        for place, kept in self._unwritten:
            first, stop = max(place, start), min(place + len(kept), start + whole.nbytes)
            if first < stop:
                whole[first - start : stop - start] = kept[first - place : stop - place]
        return whole.nbytes

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of any file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As of any file."""
        return self._file.tell()

    def flush(self) -> None:
        """No-op: writes are unbuffered."""

    def _create(self) -> io.FileIO:
        _remove_abandoned(self._path)
        self.part, descriptor = create_part(self._path)
        """The temporary file."""
        return _locked(os.fdopen(descriptor, "r+b", buffering=0))

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise output_error(self._path, self._failure) from self._failure

    def _shield(self) -> dict[int, _Handler]:
        """Defer interrupts and termination to the ends of steps; return the previous handlers."""
        if threading.current_thread() is not threading.main_thread():
            return {}
        found = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        handlers: dict[int, _Handler] = {number: before for number, before in found.items() if callable(before)}

        def handle(number: int, frame: FrameType | None) -> None:
            if self._in_step:
                self._interrupted = number
            else:
                handlers[number](number, frame)

        for number in handlers:
            signal.signal(number, handle)
        return handlers

    def _restore_handlers(self) -> None:
        for number, before in self._handlers.items():
            signal.signal(number, before)


def _remove_abandoned(path: Path) -> None:
    """Delete the parts of killed processes; BlockingIOError where another process is writing one."""
    for part in parts_of(path):
        with part.open("rb") as file:
            lock(file)
            part.unlink()


try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows has no such locks: two runs into one file go unnoticed there

    def lock(file: IO[bytes]) -> None:
        """Hold a file until it is closed; BlockingIOError where another process holds it."""
else:

    def lock(file: IO[bytes]) -> None:
        """Hold a file until it is closed; BlockingIOError where another process holds it."""
        try:
            flock(file, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            pass  # a file system without locks


def locked_file(path: Path) -> BinaryIO:
    """A file of ours, made where there is none, which `lock` holds; links are not followed."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
    return _locked(os.fdopen(os.open(path, flags, 0o666), "r+b"))


def _locked(file: F) -> F:
    """The file, which `lock` holds; it is closed where another process holds it."""
    try:
        lock(file)
    except OSError:
        file.close()
        raise
    return file
