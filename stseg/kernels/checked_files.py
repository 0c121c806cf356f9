"""Files of compiled kernels that are used only as this user wrote them: owner, mode and digest are checked first.

Reading a kernel unpickles and executes it. So a file that another user owns or may write to, or whose bytes are not
those of its digest (half written, damaged), counts as missing: the kernel is compiled again, and the file replaced.
"""

import os
import pickle
import stat
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile
from numba.core.serialize import dumps

_DIGEST = blake2b().digest_size
"""Bytes at the begin of a file."""
_pickled: Callable[[Any], bytes] = dumps
_OF_OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Others than the owner may write."""


class CheckedFiles(IndexDataCacheFile):
    """Numba's index and machine code of a kernel, behind a digest; the stamp of the sources holds numba's version."""

    def _load_index(self) -> Any:
        stamp, forms = _content(Path(self._index_path)) or (None, {})
        return forms if stamp == self._source_stamp else {}

    def _save_index(self, overloads: Any) -> None:
        self._write(self._index_path, (self._source_stamp, overloads))

    def _load_data(self, name: str) -> Any:
        found = _content(Path(self._cache_path, name))
        if found is None:
            raise FileNotFoundError(name)  # for which numba compiles again
        return found

    def _save_data(self, name: str, data: Any) -> None:
        self._write(str(Path(self._cache_path, name)), data)

    def _write(self, path: str, content: Any) -> None:
        """Write a file where there is room; without one the kernel is compiled again next time."""
        pickled = _pickled(content)
        try:
            with self._open_for_write(path) as file:
                if os.name == "posix":
                    os.fchmod(file.fileno(), stat.S_IRUSR | stat.S_IWUSR)
                file.write(blake2b(pickled).digest() + pickled)
        except OSError:
            pass


def _content(path: Path) -> Any:
    """The content of a file that this user wrote, whole; None of any other."""
    try:
        with path.open("rb") as file:
            if not is_private(os.fstat(file.fileno())):
                return None
            content = file.read()
    except OSError:
        return None
    if content[:_DIGEST] != blake2b(content[_DIGEST:]).digest():
        return None
    return pickle.loads(content[_DIGEST:])


def is_private(status: os.stat_result) -> bool:
    """Whether a file or folder is this user's, and nobody else may write to it; always where systems have no owners."""
    return os.name != "posix" or (status.st_uid == os.geteuid() and not status.st_mode & _OF_OTHERS)
