"""Compilation of kernels: the one module that names numba's options.

A kernel keeps its signature for type checkers, fills arrays that it is given, and is cached on disk
(`stseg.kernels.cache`). Kernels never use fast-math: the same input gives the same bits. With a version of numba that
`stseg.kernels.fast_compile` is written for, that module compiles; with any other version, or with
`STSEG_PLAIN_NUMBA=1`, `numba.njit` does. With `NUMBA_DISABLE_JIT=1` every kernel is plain Python.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.core import event

from stseg.kernels.cache import KernelCache

_FAST_VERSIONS = ("0.68",)
"""Versions of numba for which `stseg.kernels.fast_compile` is written."""
_NOTE_INTERVAL = 10.0
"""Interval between notes on compilation, seconds."""
COMPILED = hasattr(numba.njit(lambda: None), "py_func")
"""Whether kernels are compiled; else they are plain Python."""
FAST = COMPILED and numba.__version__.rpartition(".")[0] in _FAST_VERSIONS and "STSEG_PLAIN_NUMBA" not in os.environ
"""Whether `stseg.kernels.fast_compile` compiles."""
_KERNELS_OF_RUN = 80 if FAST else 250
"""Kernels that are compiled for a run of a rig, about; the fast way makes those that only kernels call part of them."""

if FAST:
    from stseg.kernels import fast_compile

P = ParamSpec("P")
R = TypeVar("R")

_kernels: list[Any] = []
"""All compiled kernels of the imported modules."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` without the interpreter, releasing its lock."""
    return _compiled(function)


def wide_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel without checks of divisions: x / 0 is inf or nan, as in NumPy, and loops become vector code."""
    return _compiled(function, error_model="numpy")


def part(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel for innermost loops, inlined into each kernel that calls it; it may allocate no array."""
    return _compiled(function, forceinline=True)


@contextmanager
def compilation_noted(note: Callable[[str], None]) -> Iterator[None]:
    """Call `note` with a line where a kernel is compiled within the body, and then every ten seconds."""
    with event.install_listener("numba:compile", _Notes(note)):
        yield


def load_cached_kernels() -> None:
    """Load the cached machine code of the kernels of all imported modules; a kernel that fails is left for later."""
    if FAST:
        for compiled in _kernels:
            with suppress(Exception):
                compiled.load_cached()


class _Notes(event.Listener):
    """Notes how many kernels have become ready, compiled here or by another process, each with those that it calls."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note, self._last, self._before = note, -_NOTE_INTERVAL, _ready()

    def on_start(self, event: Any) -> None:
        """A kernel is to be compiled."""
        del event
        if monotonic() - self._last >= _NOTE_INTERVAL:
            self._last = monotonic()
            done = _ready() - self._before
            progress = f"; {done} of about {_KERNELS_OF_RUN} are done" if done else ", about a minute of work"
            self._note(f"compiling kernels, once on this machine{progress}")

    def on_end(self, event: Any) -> None:
        """A kernel is compiled."""


def _ready() -> int:
    """Number of kernels for which there is machine code."""
    return sum(bool(compiled.overloads) for compiled in _kernels)


def _compiled(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    """The kernel, with numba's options."""
    if not COMPILED:
        return function
    if FAST:
        compiled = fast_compile.Kernel(function, options)
    else:
        compiled = numba.njit(nogil=True, **options | {"no_cfunc_wrapper": True})(function)
        with suppress(RuntimeError):  # no folder can be written to: compiled in each process
            compiled._cache = KernelCache(function)
    _kernels.append(compiled)
    return cast("Callable[P, R]", compiled)
