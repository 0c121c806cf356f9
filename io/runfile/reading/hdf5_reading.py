"""Reading of HDF5 files from outside, texts and attributes among it, with the errors of h5py as errors of the format.

A text of any length is a reference of 16 bytes into a global heap, with the text's length. HDF5 takes memory for that
length, up to 4 GiB, before it looks into the heap; so memory is bounded while one is read.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import h5py

from stseg.arrays import AnyArray
from stseg.errors import FormatError
from stseg.io.machine import bounded_growth
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
        found = f"something that cannot be read ({str(error)[:200]})"
        raise FormatError(path, place, found, "a whole run file") from error


def dataset_text(dataset: h5py.Dataset) -> str:
    """A single text, with bytes that are no UTF-8 escaped; ValueError where it is none."""
    with bounded_growth():
        text = dataset.asstr(errors="surrogateescape")[()]
    if not isinstance(text, str):
        raise ValueError(f"{dataset.name}: no text")
    return text


def dataset_texts(dataset: h5py.Dataset) -> AnyArray:
    """Texts, str objects in the dataset's shape; raises what h5py raises where it holds others."""
    with bounded_growth():
        return dataset.asstr()[()]  # type: ignore[no-any-return]


def read_attribute(owner: h5py.Group | h5py.Dataset, key: str) -> Any:
    """An attribute as h5py gives it; KeyError where there is none."""
    with bounded_growth():
        return owner.attrs[key]
