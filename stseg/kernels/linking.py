"""Kernels that kernels call become machine code within these alone.

Numba makes machine code of a kernel with all that it calls, and of each kernel that it calls with all that this one
calls, and so on: most of that code never runs. Here the code of a kernel is linked into its callers as it is, and is
optimised once a kernel's address is asked for, which Python needs to call it. The parts of numba that this replaces
are not documented; `pyproject.toml` says of which version they are.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cached_property
from typing import Any, ClassVar

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime.context import NRTContext
from numba.core.typed_passes import NativeLowering

from stseg.kernels.cache import KernelCache, kept_code
from stseg.kernels.short_lowering import ShortLowering, references

_KNOWN_OUTSIDE = ("external", "common")
"""Kinds of names that may be asked for."""
_INNER = {"no_cpython_wrapper": True}
"""An inner kernel has no form that Python could call."""


class Kernel(CPUDispatcher):
    """A kernel that Python and kernels call.

    Parameters
    ----------
    function
        The kernel as plain Python.
    options
        Numba's.
    """

    made: ClassVar[list[Kernel]] = []
    """All of them."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=options)
        self.made.append(self)

    @cached_property
    def _inner(self) -> Any:
        """The same kernel as part of others."""
        return CPUDispatcher(self.py_func, targetoptions=self.targetoptions | _INNER)

    @property
    def _numba_type_(self) -> Any:
        """The type by which numba finds what a kernel calls."""
        return self._inner._numba_type_

    def compile(self, sig: Any) -> Any:
        """Compile for the types of some arguments, or take the machine code from the cache."""
        alone = self._kept.alone() if isinstance(self._kept, KernelCache) else nullcontext()
        with global_compiler_lock, alone, _nothing_collected(), _optimised_late(cpu_target.target_context.codegen()):
            self._cache = self._kept
            return super().compile(sig)

    def take_kept(self) -> None:
        """Take from the cache what it holds of this kernel, for arguments of whatever types."""
        if isinstance(self._kept, KernelCache):
            for types in self._kept.kept_types(cpu_target.target_context.codegen()):
                self.compile(types)

    @cached_property
    def _kept(self) -> Any:
        """Its machine code on disk, which most kernels are not asked for in a run."""
        return kept_code(self.py_func)


class _Library(JITCodeLibrary):
    """Code of a kernel, not optimised before its address is asked for."""

    _optimised = False

    def finalize(self) -> None:
        """Link what is called."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function; 0 where this code does not define it."""
        self._ensure_finalized()
        if not self._optimised:
            if not any(function.name == name for function in self.get_defined_functions()):
                return 0
            self._optimize_final_module()
            self._final_module.verify()
            self._finalize_final_module()
        return int(super().get_pointer_to_function(name))

    def serialize_using_object_code(self) -> tuple[str, bytes, list[str]]:
        """Name and machine code, with the names that Python asks for; kernels link the inner form instead."""
        made = self._final_module
        names = [
            one.name
            for one in (*made.functions, *made.global_variables)
            if not one.is_declaration and one.linkage.name in _KNOWN_OUTSIDE
        ]
        return self.name, self._get_compiled_object(), names

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, bytes, list[str]]) -> Any:
        """Code as it was kept."""
        name, code, names = state
        library = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        codegen._engine._defined_symbols.update(names)
        return library

    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave functions as they are, until they are optimised together."""
        ll_module.data_layout = self._codegen._data_layout

    def _finalize_final_module(self) -> None:
        self._optimised = True
        super()._finalize_final_module()


@contextmanager
def _nothing_collected() -> Iterator[None]:
    """Collect no garbage within the body: what a compiler makes mostly stays, and each collection visits all of it."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


@contextmanager
def _optimised_late(codegen: Any) -> Iterator[None]:
    """Let all code that is made within the body, numba's own functions included, be of that kind."""
    set_environment = codegen.set_env

    def set_where_known(name: str, environment: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            set_environment(name, environment)

    with (
        _replaced(codegen, "_library_class", _Library),
        _replaced(codegen, "set_env", set_where_known),
        _replaced(NativeLowering, "lowering_class", ShortLowering),
        _replaced(NRTContext, "get_meminfos", references),
    ):
        yield


@contextmanager
def _replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Let an attribute have another value within the body."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)
