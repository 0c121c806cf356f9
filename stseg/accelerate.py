"""Compilation of kernels: the one module that names numba's options.

A kernel keeps its signature for type checkers, fills arrays that it is given, and is cached on disk. Kernels never use
fast-math: the same input gives the same bits. With `NUMBA_DISABLE_JIT=1` every kernel is plain Python.

The cache on disk checks the kernel's own file alone: after an edit to a kernel that kernels of other files call, delete
their caches (`find . -name '*.nb[ci]' -delete`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

_UNCOUNTED: dict[str, Any] = {"_nrt": False}

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


def _compiled(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    try:
        return cast("Callable[P, R]", numba.njit(cache=True, nogil=True, **options)(function))
    except RuntimeError:  # neither the package's folder nor the home can be written: compiled in each process
        return cast("Callable[P, R]", numba.njit(nogil=True, **options)(function))


def python_form(compiled: Callable[P, R]) -> Callable[P, R]:
    """The kernel as plain Python, for tests that compare the two."""
    return cast("Callable[P, R]", getattr(compiled, "py_func", compiled))
