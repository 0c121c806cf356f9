"""Kernels that kernels call become machine code within these alone: half the work of a first run.

Numba makes machine code of a kernel with all that it calls, and of each kernel that it calls with all that this one
calls, and so on: most of that code never runs. Here the code of a kernel is linked into its callers as it is, and is
optimised once a kernel's address is asked for, which Python needs to call it. The parts of numba that this replaces
are not documented; `stseg.kernels.accelerate` says of which versions they are.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cached_property
from typing import Any

from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime.nrt import rtsys
from numba.core.types import unliteral

from stseg.kernels.cache import KernelCache, KernelFiles, locked

_EXPORTED_LINKAGES = ("external", "common")
"""Linkages of names with an address for other code."""
_OPTIONS = {"nopython": True, "nogil": True, "no_cfunc_wrapper": True}
_INNER_OPTIONS = {"no_cpython_wrapper": True}
"""An inner kernel has no form that Python could call."""
_INLINED_OPTIONS = {"_nrt": False}
"""No reference is counted for the arguments of an inlined kernel."""


class Kernel(CPUDispatcher):
    """A kernel that Python and kernels call, from plain Python and numba's options."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        inlined = _INLINED_OPTIONS if options.get("forceinline") else {}
        super().__init__(function, targetoptions=_OPTIONS | inlined | options)

    @cached_property
    def _inner(self) -> Any:
        """The same kernel as part of others."""
        return _InnerKernel(self.py_func, targetoptions=self.targetoptions | _INNER_OPTIONS)

    @property
    def _numba_type_(self) -> Any:
        """The type by which numba finds the kernels that a kernel calls."""
        return self._inner._numba_type_

    def compile(self, sig: Any) -> Any:
        """Compile for the types of some arguments, or load the machine code from the cache."""
        exclusive = self._disk.exclusive() if isinstance(self._disk, _FastCache) else nullcontext()
        with global_compiler_lock, exclusive, _without_collection(), _late_optimisation():
            self._cache = self._disk
            return super().compile(sig)

    def load_cached(self) -> None:
        """Load from the cache the machine code of this kernel, for arguments of all types."""
        if isinstance(self._disk, _FastCache):
            for types in self._disk.cached_types(cpu_target.target_context.codegen()):
                self.compile(types)

    @cached_property
    def _disk(self) -> Any:
        """Its machine code on disk, which most kernels do not need in a run."""
        try:
            return _FastCache(self.py_func)
        except RuntimeError:  # no folder can be written to
            return NullCache()


class _InnerKernel(CPUDispatcher):
    """A kernel as part of others."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """The form for the types of some arguments: -1 is a whole number like others, not a type of its own."""
        return super().get_call_template([unliteral(one) for one in args], kws)


class _FastFiles(KernelFiles):
    """A kernel on disk without the names of numba's modules, each of which would be imported."""

    def reduce(self, cres: Any) -> Any:
        """The result of a compilation; of environments those alone that hold Python's objects."""
        *stored, environments = super().reduce(cres)
        return *stored, [environment for environment in environments if environment.consts]


class _FastCache(KernelCache):
    """Machine code of a kernel, read without numba's registry of functions and types: compiling alone needs it."""

    _impl_class = _FastFiles

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for the types of some arguments; None where there is none."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Let other processes that want kernels of this file wait; then these find the code made within the body."""
        with suppress(OSError):
            self._impl.locator.ensure_cache_path()
        with locked(self.cache_path):
            yield

    def cached_types(self, codegen: Any) -> list[Any]:
        """Types of the arguments for which machine code of this processor is on disk."""
        keys = self._cache_file._load_index()
        return [types for types, *_ in keys if self._index_key(types, codegen) in keys]


class _Library(JITCodeLibrary):
    """Code of a kernel, not optimised before its address is asked for."""

    _optimised = False

    def finalize(self) -> None:
        """Link the code of the called kernels."""
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
        module = self._final_module
        names = [
            symbol.name
            for symbol in (*module.functions, *module.global_variables)
            if not symbol.is_declaration and symbol.linkage.name in _EXPORTED_LINKAGES
        ]
        return self.name, self._get_compiled_object(), names

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, bytes, list[str]]) -> Any:
        """Code as it was stored."""
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
def _without_collection() -> Iterator[None]:
    """Collect no garbage within the body: what a compiler makes mostly stays, and each collection visits all of it."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def _late_optimisation() -> Iterator[None]:
    """Let all code that is made within the body, numba's own functions included, be a `_Library`."""
    codegen = cpu_target.target_context.codegen()
    library_class, set_environment = codegen._library_class, codegen.set_env

    def set_where_defined(name: str, environment: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            set_environment(name, environment)

    codegen._library_class, codegen.set_env = _Library, set_where_defined
    try:
        yield
    finally:
        codegen._library_class, codegen.set_env = library_class, set_environment
