"""The folder of compiled kernels, and when they are stale.

Kernels lie in the user's cache folder, so that they outlive an installation and need no writable one. A kernel is
stale when its file changes, or a file of kernels or constants that its file imports: numba copies both into it. All
are stale when numba has another version or code is made in another way.
"""

import atexit
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Self

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache

from stseg.kernels.checked_files import CheckedFiles, is_private

if sys.platform != "win32":
    import fcntl

_PACKAGE = Path(__file__).parents[1]
_IMPORT = re.compile(rb"^from (stseg[\w.]*) import |^import (stseg[\w.]*)", re.MULTILINE)
_IMPORT_OF_KERNELS = b"from stseg.kernels.accelerate import"
_COMPILING_FILES = tuple(
    _PACKAGE / "kernels" / name for name in ("accelerate.py", "cache.py", "checked_files.py", "fast_compile.py")
)
_PATIENCE = 60.0
"""Time to wait for another process that compiles kernels of the same file, seconds."""
_PAUSE = 0.02
"""Time between two tries, seconds."""


class KernelFolder:
    """Locator of the files of a kernel (`function`, plain Python in the file `source`), as numba asks for one."""

    def __init__(self, function: Callable[..., object], source: str) -> None:
        self._line = function.__code__.co_firstlineno
        self._stamp = source_stamp(Path(source))
        self._path = folder() / function.__module__ / self._stamp

    @classmethod
    def from_function(cls, function: Callable[..., object], source: str) -> Self | None:
        """The locator of a kernel; None where no folder can be written to."""
        try:
            return cls(function, source)
        except OSError:
            return None

    def ensure_cache_path(self) -> None:
        """Make the folder, where there is room."""
        with suppress(OSError):
            self._path.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """The folder of the kernel's files."""
        return str(self._path)

    def get_source_stamp(self) -> str:
        """Changes with the sources."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """Identifier that distinguishes kernels of one name and file."""
        return str(self._line)


class KernelFiles(CompileResultCacheImpl):
    """Numba's form of a kernel on disk, in our folder."""

    _locator_classes: list[type[object]] = [KernelFolder]  # noqa: RUF012  # as numba declares it


class KernelCache(FunctionCache):
    """Machine code of a kernel on disk. RuntimeError where no folder can be written to."""

    _impl_class = KernelFiles

    def __init__(self, function: Callable[..., object]) -> None:
        super().__init__(function)
        self._cache_file = CheckedFiles(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )


@contextmanager
def locked(place: str) -> Iterator[None]:
    """Hold the lock of a folder within the body, where systems have such locks; after a minute go on without it."""
    if sys.platform == "win32":
        yield
        return
    opened = None
    with suppress(OSError):
        opened = os.open(place, os.O_RDONLY)
        _lock(opened)
    try:
        yield
    finally:
        if opened is not None:
            os.close(opened)


def _lock(opened: int) -> None:
    """Lock an open folder; after `_PATIENCE` go on without, as the other process may have been stopped."""
    for _ in range(round(_PATIENCE / _PAUSE)):
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(_PAUSE)


@cache
def folder() -> Path:
    """The folder of all kernels: the first that is this user's and can be written to; else a temporary one."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    for place in (Path(named) / "stseg" if named else None, _folder_of_user()):
        if place is not None and _is_usable(place):
            return place
    temporary = Path(tempfile.mkdtemp(prefix="stseg-kernels-"))
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return temporary


@cache
def source_stamp(path: Path) -> str:
    """Digest of a file, of the files that its kernels import, in turn where those have kernels, and of the compiler."""
    sources, waiting = set(_COMPILING_FILES), [path]
    while waiting:
        source = waiting.pop()
        if source not in sources:
            sources.add(source)
            if source == path or _IMPORT_OF_KERNELS in _content(source):
                waiting += _imported_files(source)
    digest = blake2b(f"{numba.__version__} {'STSEG_PLAIN_NUMBA' in os.environ}".encode(), digest_size=12)
    for source in sorted(sources, key=lambda file: file.as_posix()):
        digest.update(_content(source) + b"\0")
    return digest.hexdigest()


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


def _imported_files(path: Path) -> list[Path]:
    """Files of this package that a file imports."""
    files = []
    for names in _IMPORT.findall(_content(path)):
        module = _PACKAGE.joinpath(*(names[0] or names[1]).decode().split(".")[1:])
        files += [file for file in (module.with_suffix(".py"), module / "__init__.py") if file.is_file()]
    return files


def _folder_of_user() -> Path | None:
    """The user's cache folder, by the custom of each system."""
    try:
        home = Path.home()
    except RuntimeError:  # a user without one
        return None
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or home / ".cache"
    return Path(base) / "stseg" / "kernels"


def _is_usable(place: Path) -> bool:
    """Whether a folder is this user's alone and has room; one of this user's is made private (0700)."""
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if os.name == "posix" and place.stat().st_uid == os.geteuid():
            place.chmod(0o700)
        with tempfile.TemporaryFile(dir=place):
            return is_private(place.stat())
    except OSError:
        return False
