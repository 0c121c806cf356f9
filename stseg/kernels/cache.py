"""Where compiled kernels are kept, and when they are stale.

Kernels are kept in the user's cache folder, so that they outlive an installation and need no writable one. A kernel is
stale when its file changes, or a file of kernels or constants that its file imports: numba copies both into it. All
are stale when code is made, linked, or kept in another way.
"""

from __future__ import annotations

import atexit
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, Self

from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.runtime.nrt import rtsys

if sys.platform != "win32":
    import fcntl

_PACKAGE = Path(__file__).parents[1]
_IMPORTED = re.compile(rb"^from (stseg[\w.]*) import |^import (stseg[\w.]*)", re.MULTILINE)
_KERNELS = b"from stseg.kernels.accelerate import"
_KEEPING = tuple(_PACKAGE / "kernels" / name for name in ("linking.py", "cache.py", "short_lowering.py"))


class KernelFolder:
    """Locator of a kernel's files, as numba asks for one.

    Parameters
    ----------
    function, source
        The kernel as plain Python, and its file.
    """

    def __init__(self, function: Callable[..., Any], source: str) -> None:
        self._line = function.__code__.co_firstlineno
        self._stamp = source_stamp(Path(source))
        self._path = folder() / function.__module__ / self._stamp

    @classmethod
    def from_function(cls, function: Callable[..., Any], source: str) -> Self | None:
        """The locator of a kernel; None where no folder can be written to."""
        try:
            return cls(function, source)
        except OSError:
            return None

    def ensure_cache_path(self) -> None:
        """Make the folder."""
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


class _CompiledKernel(CompileResultCacheImpl):
    """What is kept of a kernel, and where."""

    _locator_classes: list[type[object]] = [KernelFolder]  # noqa: RUF012  # as numba declares it

    def reduce(self, cres: Any) -> Any:
        """The result of a compilation; of environments those alone that hold Python's objects."""
        *kept, environments = super().reduce(cres)
        return *kept, [one for one in environments if one.consts]


class KernelCache(FunctionCache):
    """Machine code of a kernel, read without all that numba knows of functions and types: compiling alone needs it."""

    _impl_class = _CompiledKernel

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for the types of some arguments; None where there is none."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Let other processes that want kernels of this file wait; then these find what was made within the body."""
        with ExitStack() as held:
            with suppress(OSError):  # some file systems know no locks
                self._impl.locator.ensure_cache_path()
                held.enter_context(_locked(self.cache_path))
            yield

    def kept_types(self, codegen: Any) -> list[Any]:
        """Types of the arguments for which machine code of this processor is kept."""
        keys = self._cache_file._load_index()
        return [types for types, *_ in keys if self._index_key(types, codegen) in keys]


def kept_code(function: Callable[..., Any]) -> Any:
    """The machine code of a kernel on disk; one that keeps nothing where no folder can be written to."""
    try:
        return KernelCache(function)
    except RuntimeError:
        return NullCache()


@contextmanager
def _locked(place: str) -> Iterator[None]:
    """Hold the lock of a folder, where the system has such locks."""
    if sys.platform == "win32":
        yield
        return
    opened = os.open(place, os.O_RDONLY)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX)
        yield
    finally:
        os.close(opened)


@cache
def folder() -> Path:
    """The folder of all kernels: the first that can be written to; else one of this process alone."""
    for place in (_asked(), _of_user()):
        if place is not None and _writable(place):
            return place
    own = Path(tempfile.mkdtemp(prefix="stseg-kernels-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return own


@cache
def source_stamp(path: Path) -> str:
    """Digest of a file and of all files whose kernels or constants are compiled into its kernels, and of how."""
    seen, waiting = set(_KEEPING), [path]
    while waiting:
        one = waiting.pop()
        if one not in seen:
            seen.add(one)
            if one == path or _KERNELS in _bytes(one):
                waiting += _imported(one)
    digest = blake2b(digest_size=12)
    for one in sorted(seen, key=lambda file: file.as_posix()):
        digest.update(_bytes(one) + b"\0")
    return digest.hexdigest()


@cache
def _bytes(path: Path) -> bytes:
    return path.read_bytes()


def _imported(path: Path) -> list[Path]:
    """Files of this package that a file imports."""
    found = []
    for names in _IMPORTED.findall(_bytes(path)):
        own = _PACKAGE.joinpath(*(names[0] or names[1]).decode().split(".")[1:])
        found += [file for file in (own.with_suffix(".py"), own / "__init__.py") if file.is_file()]
    return found


def _asked() -> Path | None:
    asked = os.environ.get("NUMBA_CACHE_DIR")
    return Path(asked) / "stseg" if asked else None


def _of_user() -> Path | None:
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


def _writable(place: Path) -> bool:
    try:
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place):
            return True
    except OSError:
        return False
