"""Kernels in LLVM's language, in fewer words than numba's.

Numba copies the structure of an array, and takes all of it apart, wherever an element is read or a reference counted,
divides to find how often a loop runs, and clears each variable after its last use. LLVM removes nearly all of that,
which is much of its work; what remains is the same. The parts of numba that this replaces are not documented
(`stseg.kernels.linking`).
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, reduce
from typing import Any

from numba.core import cgutils, types
from numba.core.ir_utils import get_definition, guard
from numba.core.lowering import Lower

_DATA, _SHAPE, _STRIDES = 4, 5, 6
"""Places of what an element's address depends on in numba's structure of an array."""
_PARTS_OF_RANGE = 3
"""Start, stop, and step."""
_PAIR = ("pair_first", "pair_second")
"""What is taken of an iterator's answer: the next value, and whether there was one."""


class ShortLowering(Lower):
    """Lowering of one kernel."""

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Assign a variable; what it held before matters where it is counted."""
        if self._counted(self.typeof(name)) or argidx is not None or name in self._singly_assigned_vars:
            super().storevar(value, name, argidx)
        else:
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.getvar(name))

    def delvar(self, name: str) -> None:
        """End a variable; it is cleared where it is counted."""
        if self._counted(self.typeof(name)):
            super().delvar(name)
        elif name not in self._blk_local_varmap:
            self._singly_assigned_vars.discard(name)

    def create_cfunc_wrapper(self) -> None:
        """No form of a kernel is for C."""

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        """`array[j, k]`."""
        if not _is_element(signature):
            return super().lower_getitem(resty, expr, value, index, signature)
        array, places = signature.args
        at = self._address(array, self._cast_var(value, array), places, self._cast_var(index, places))
        element = self.context.unpack_value(self.builder, array.dtype, at)
        return self.context.cast(self.builder, element, array.dtype, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        """`array[j, k] = value`."""
        if not _is_element(signature):
            return super().lower_setitem(target_var, index_var, value_var, signature)
        array, places, kind = signature.args
        at = self._address(array, self._cast_var(target_var, array), places, self._cast_var(index_var, places))
        value = self.context.cast(self.builder, self._cast_var(value_var, kind), kind, array.dtype)
        return self.context.pack_value(self.builder, array.dtype, value, at)

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """An expression; numbers of a range and how often it goes on without division."""
        if expr.op in _PAIR and not self._counted(resty):
            return self.builder.extract_value(self.loadvar(expr.value.name), _PAIR.index(expr.op))
        if expr.op in ("getiter", "iternext"):
            kind = self.typeof(expr.value.name)
            if isinstance(kind, types.RangeType) and self._goes_by_one(expr.value):
                return self._range_iterator(resty, self.loadvar(expr.value.name))
            if isinstance(kind, types.RangeIteratorType) and expr.op == "iternext":
                return self._next_of_range(resty, self.loadvar(expr.value.name))
        return super().lower_expr(resty, expr)

    def _counted(self, kind: Any) -> bool:
        """Whether values of a type hold references."""
        return _counted(self.context.data_model_manager, kind)

    def _address(self, array: Any, structure: Any, places: Any, index: Any) -> Any:
        """Address of an element."""
        several = isinstance(places, types.BaseTuple)
        numbers = cgutils.unpack_tuple(self.builder, index) if several else [index]
        steps = [
            self._from_start(kind, number, structure, axis)
            for axis, (kind, number) in enumerate(zip(places if several else [places], numbers, strict=True))
        ]
        data = self.builder.extract_value(structure, _DATA)
        if array.layout == "C":
            return self.builder.gep(data, [self._number_of(steps, structure)])
        offset = self._sum(self.builder.mul(self._size(structure, _STRIDES, k), step) for k, step in enumerate(steps))
        return cgutils.pointer_add(self.builder, data, offset)

    def _number_of(self, steps: list[Any], structure: Any) -> Any:
        """The number of an element of a contiguous array."""
        parts, size = [steps[-1]], None
        for axis in range(len(steps) - 1, 0, -1):
            length = self._size(structure, _SHAPE, axis)
            size = length if size is None else self.builder.mul(size, length)
            parts.append(self.builder.mul(steps[axis - 1], size))
        return self._sum(parts[::-1])

    def _from_start(self, kind: Any, number: Any, structure: Any, axis: int) -> Any:
        """A number along an axis, where signed ones below 0 count from the end."""
        if not kind.signed or (isinstance(number, cgutils.ir.Constant) and number.constant >= 0):
            return number
        from_end = self.builder.add(number, self._size(structure, _SHAPE, axis))
        return self.builder.select(self.builder.icmp_signed("<", number, number.type(0)), from_end, number)

    def _size(self, structure: Any, field: int, axis: int) -> Any:
        """The length of an axis, or its stride."""
        return self.builder.extract_value(structure, [field, axis])

    def _sum(self, parts: Iterable[Any]) -> Any:
        return reduce(self.builder.add, parts)

    def _goes_by_one(self, variable: Any) -> bool:
        """Whether a range was made here without a step."""
        made = guard(get_definition, self.func_ir, variable)
        if getattr(made, "op", None) != "call" or made.vararg is not None or len(made.args) == _PARTS_OF_RANGE:
            return False
        return getattr(self.typeof(made.func.name), "typing_key", None) is range

    def _range_iterator(self, kind: Any, span: Any) -> Any:
        """The iterator of a range: addresses of the next number and of how many are left, besides stop and step."""
        start, stop, step = cgutils.unpack_tuple(self.builder, span)
        length = self.builder.sub(stop, start)
        left = self.builder.select(self.builder.icmp_signed(">", length, length.type(0)), length, length.type(0))
        places = (cgutils.alloca_once_value(self.builder, one) for one in (start, left))
        return self._structure(kind, next(places), stop, step, next(places))

    def _next_of_range(self, kind: Any, iterator: Any) -> Any:
        """The next number, and whether there was one left."""
        place, _, step, left_place = cgutils.unpack_tuple(self.builder, iterator)
        number, left = self.builder.load(place), self.builder.load(left_place)
        more = self.builder.icmp_signed(">", left, left.type(0))
        with self.builder.if_then(more):  # else no loop becomes vector code
            self.builder.store(self.builder.add(number, step), place)
            self.builder.store(self.builder.sub(left, left.type(1), flags=["nsw"]), left_place)
        return self._structure(kind, number, more)

    def _structure(self, kind: Any, *values: Any) -> Any:
        """A structure of values."""
        made = cgutils.ir.Constant(self.context.get_value_type(kind), cgutils.ir.Undefined)
        for place, value in enumerate(values):
            made = self.builder.insert_value(made, value, place)
        return made


def references(counting: Any, builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """Types and values of what is counted within a value; nothing else is taken out of it."""
    models = counting._context.data_model_manager
    if models[kind].has_nrt_meminfo():
        return [(kind, models[kind].get_nrt_meminfo(builder, value))]
    return [
        one
        for member, field in models[kind].traverse(builder)
        if _counted(models, member)
        for one in references(counting, builder, member, field(value))
    ]


@cache
def _counted(models: Any, kind: Any) -> bool:
    """Whether values of a type hold references."""
    return bool(models[kind].contains_nrt_meminfo())


def _is_element(signature: Any) -> bool:
    """Whether an array of numbers has a place for each axis."""
    array, places = signature.args[:2]
    if not isinstance(array, types.Array) or not isinstance(array.dtype, types.Number | types.Boolean):
        return False
    kinds = getattr(places, "types", (places,))  # of a tuple
    whole = len(kinds) == array.ndim and all(isinstance(kind, types.Integer) for kind in kinds)
    return whole and array.aligned and array.layout in "CA"
