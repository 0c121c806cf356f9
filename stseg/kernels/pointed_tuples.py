"""Named tuples that kernels pass on by their address.

Numba passes a tuple of arrays as some hundred numbers, taken apart and put together at each call, which is most of what
there is to compile in kernels that pass a large one on. An address is one number. As plain Python, and with numba
0.61, tuples are passed as they are.
"""

from typing import Any, TypeVar

import numba
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_builtin, lower_getattr_generic, models, register_model, type_callable

Fields = TypeVar("Fields")

_BY_ADDRESS = tuple(map(int, numba.__version__.split(".")[:2])) > (0, 61)
"""Whether there are addresses: LLVM 15, of numba 0.61, makes invalid vector code of loops that read through them."""


def pointed(fields: Fields) -> Fields:
    """The same named tuple by its address, valid until the kernel that asks for it returns.

    It is an argument of that kernel, since the caller holds the arrays of arguments for as long, or is used by name
    after the last use of its address: numba lets go of what a kernel has made itself after its last use by name.
    """
    return fields


class Pointed(types.Type):
    """The type of a named tuple by its address; `fields` is the type of the tuple."""

    def __init__(self, fields: Any) -> None:
        self.fields = fields
        super().__init__(f"Pointed({fields})")


@register_model(Pointed)
class _PointedModel(models.PrimitiveModel):
    """An address."""

    def __init__(self, manager: Any, pointed_type: Any) -> None:
        super().__init__(manager, pointed_type, manager[pointed_type.fields].get_value_type().as_pointer())


@type_callable(pointed)
def _type_pointed(_: Any) -> Any:
    def typer(fields: Any) -> Any:
        if not isinstance(fields, types.BaseNamedTuple):
            return None
        return Pointed(fields) if _BY_ADDRESS else fields

    return typer


@lower_builtin(pointed, types.BaseNamedTuple)
def _lower_pointed(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    if not _BY_ADDRESS:
        return impl_ret_borrowed(context, builder, signature.return_type, arguments[0])
    return cgutils.alloca_once_value(builder, arguments[0])


@infer_getattr
class _PointedAttributes(AttributeTemplate):
    key = Pointed

    def generic_resolve(self, pointed_type: Any, name: str) -> Any:  # type: ignore[override]
        """The type of a field; tuples within the tuple are passed on by address, too."""
        if name not in pointed_type.fields.fields:
            return None
        field = pointed_type.fields[pointed_type.fields.fields.index(name)]
        return Pointed(field) if isinstance(field, types.BaseNamedTuple) else field


@lower_getattr_generic(Pointed)
def _lower_field(context: Any, builder: Any, pointed_type: Any, address: Any, name: str) -> Any:
    place = pointed_type.fields.fields.index(name)
    field = pointed_type.fields[place]
    at = cgutils.gep_inbounds(builder, address, 0, place)
    if isinstance(field, types.BaseNamedTuple):
        return at
    return impl_ret_borrowed(context, builder, field, builder.load(at))
