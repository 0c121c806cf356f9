"""Reading of HDF5 files, with the errors of h5py as errors of the format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import h5py

from stseg.errors import FormatError
from stseg.io.untrusted.names import printable
from stseg.io.untrusted.safe_hdf5 import open_hdf5

T = TypeVar("T")


def read_object(path: Path, place: str, take: Callable[[h5py.File], T]) -> T:
    """The value of `take` for an open file; raises FormatError with the place in the file."""
    with format_errors(path, place), open_hdf5(path) as file:
        return take(file)


@contextmanager
def format_errors(path: Path, place: str) -> Iterator[None]:
    """Raise what h5py raises as FormatError, which names the file and the place in it."""
    try:
        yield
    except FileNotFoundError as error:
        raise FormatError(path, "", "no such file", "a run file") from error
    except BlockingIOError as error:
        raise FormatError(path, "", "a file that is still being written", "a finished run file") from error
    except PermissionError as error:
        raise FormatError(path, "", "a file that this user may not read", "a run file") from error
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:  # whatever h5py raises on broken files
        if path.is_file() and not h5py.is_hdf5(path):
            raise FormatError(path, "", "something that is not HDF5", "a run file") from error
        found = f"something that cannot be read ({printable(str(error))[:200]})"
        raise FormatError(path, place, found, "a whole run file") from error
