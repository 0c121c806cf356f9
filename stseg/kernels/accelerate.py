"""Compilation of kernels: the one module that names numba's options.

A kernel keeps its signature for type checkers, fills arrays that it is given, and is cached on disk
(`stseg.kernels.cache`). Kernels never use fast-math: the same input gives the same bits. With `NUMBA_DISABLE_JIT=1`
every kernel is plain Python.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.core import event

from stseg.kernels.linking import Kernel

_UNCOUNTED: dict[str, Any] = {"_nrt": False}
"""No reference is counted for the arguments of an inlined kernel: an option that numba does not document."""
_PAUSE = 10.0
"""Seconds between notes on compilation."""
_USUAL = 80
"""Kernels that Python calls in a run of a rig, about; those that only kernels call are part of these."""

COMPILED = hasattr(numba.njit(lambda: None), "py_func")
"""Whether kernels are compiled; else they are plain Python."""

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` without the interpreter, releasing its lock."""
    return _compiled(function)


def wide_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel whose divisions are not checked: x / 0 is inf or nan, as in NumPy, and loops become vector code."""
    return _compiled(function, error_model="numpy")


def part(function: Callable[P, R]) -> Callable[P, R]:
    """A kernel for innermost loops, inlined into each kernel that calls it; it may allocate no array.

    Arguments are neither passed on nor reference-counted.
    """
    return _compiled(function, forceinline=True, **_UNCOUNTED)


def python_form(compiled: Callable[P, R]) -> Callable[P, R]:
    """The kernel as plain Python, for tests that compare the two."""
    return cast("Callable[P, R]", getattr(compiled, "py_func", compiled))


@contextmanager
def compilation_noted(note: Callable[[str], None]) -> Iterator[None]:
    """Call `note` with a line where a kernel is compiled within the body, and then every ten seconds."""
    listener = _Notes(note)
    with event.install_listener("numba:compile", listener):
        yield


def take_kept_kernels() -> None:
    """Take from the cache what it holds of the kernels of all imported modules; what fails is left for later."""
    for one in Kernel.made:
        with suppress(Exception):
            one.take_kept()


class _Notes(event.Listener):
    """Notes how many kernels have become ready, compiled here or by another process, each with those that it calls."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note, self._last, self._before = note, -_PAUSE, _ready()

    def on_start(self, event: Any) -> None:
        """A kernel is to be compiled."""
        del event
        if monotonic() - self._last >= _PAUSE:
            self._last = monotonic()
            done = _ready() - self._before
            so_far = f"; {done} of about {_USUAL} are done" if done else ", about a minute of work"
            self._note(f"compiling kernels, once on this machine{so_far}")

    def on_end(self, event: Any) -> None:
        """A kernel is compiled."""


def _ready() -> int:
    """Number of kernels for which there is machine code."""
    return sum(bool(one.overloads) for one in Kernel.made)


def _compiled(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    """The kernel, with numba's options."""
    if not COMPILED:
        return function
    made = Kernel(function, {"nopython": True, "nogil": True, "no_cfunc_wrapper": True, **options})
    return cast("Callable[P, R]", made)
