"""Numba's internals: arrays made of bare memory, and the engine's arrays as one value.

Numba's own ways to them count references, and a tuple of two dozen arrays, each of seven
numbers, takes the compiler most of a minute.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
)
from numba.np import arrayobj

from pendpipe.dynamics.layout import ADDRESSES, COUNTS, FIELDS, REQUEST

# Numba gives these no types.
make_array: Any = arrayobj.make_array
populate_array: Any = arrayobj.populate_array
struct_proxy: Any = cgutils.create_struct_proxy
unpacked: Any = cgutils.unpack_tuple
lower_attributes: Any = lower_getattr_generic

_ITEM = 8
_INTEGERS = types.Array(types.int64, 1, "C")
_VECTOR = types.Array(types.float64, 1, "C")
_MATRIX = types.Array(types.float64, 2, "C")


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: Any) -> Any:
    """Make the array of a kind and shape whose numbers begin at `data`."""
    result = make_array(kind)(context, builder)
    item = context.get_constant(types.intp, _ITEM)
    strides = [builder.mul(shape[1], item), item] if len(shape) == 2 else [item]
    populate_array(
        result, data=data, shape=list(shape), strides=strides, itemsize=item, meminfo=None
    )
    return result._getvalue()


def _vector(_typing: Any, pointer: Any, size: Any) -> Any:
    """Return the array of `size` numbers at `pointer`."""
    kind = _INTEGERS if pointer.dtype == types.int64 else _VECTOR

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _array(context, builder, kind, arguments[0], arguments[1:])

    return kind(pointer, size), generate


def _matrix(_typing: Any, numbers: Any, rows: Any, columns: Any) -> Any:
    """Return the (rows, columns) array that begins where the array `numbers` begins."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = make_array(signature.args[0])(context, builder, arguments[0])
        return _array(context, builder, _MATRIX, source.data, arguments[1:])

    return _MATRIX(numbers, rows, columns), generate


vector: Any = intrinsic(_vector)
matrix: Any = intrinsic(_matrix)


class _Work(types.Type):
    """The type of `layout.Work`."""

    def __init__(self) -> None:
        super().__init__(name="Work")


_WORK = _Work()
_ADDRESS: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]


@register_model(_Work)
class _WorkModel(models.StructModel):
    """Addresses and counts."""

    def __init__(self, manager: Any, kind: Any) -> None:
        members = [(name, _ADDRESS) for name in ADDRESSES]
        members += [(name, types.intp) for name in COUNTS]
        super().__init__(manager, kind, members)  # type: ignore[no-untyped-call]


@infer_getattr
class _WorkAttributes(AttributeTemplate):
    """The attributes' types."""

    key = _Work

    def generic_resolve(self, _kind: Any, name: str) -> Any:  # type: ignore[override]
        """Return an array's type for a field, or an integer's for a count."""
        if name in FIELDS:
            return _VECTOR if FIELDS[name].rows is None else _MATRIX
        return types.intp if name in COUNTS else None


@lower_attributes(_Work)
def _attribute(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """Make the array of a field, or give a count."""
    work = struct_proxy(kind)(context, builder, value=value)

    def size(count: tuple[str, int]) -> Any:
        constant = context.get_constant(types.intp, count[1])
        return builder.add(getattr(work, count[0]), constant) if count[0] else constant

    if name in COUNTS:
        return getattr(work, name)
    field = FIELDS[name]
    widths = builder.mul(work.width, context.get_constant(types.intp, field.widths))
    offset = builder.add(context.get_constant(types.intp, field.offset), widths)
    data = builder.gep(getattr(work, field.owner), [offset])
    shape = [size(count) for count in (field.rows, field.columns) if count is not None]
    return _array(context, builder, _VECTOR if field.rows is None else _MATRIX, data, shape)


def _gather(_typing: Any, request: Any, counts: Any) -> Any:
    """Return the `layout.Work` of a request and the counts that follow from it."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        work = struct_proxy(_WORK)(context, builder)
        for name in ADDRESSES:
            place = context.get_constant(types.intp, REQUEST.index(name))
            address = builder.load(builder.gep(arguments[0], [place]))
            setattr(work, name, builder.inttoptr(address, context.get_value_type(_ADDRESS)))
        for name, count in zip(COUNTS, unpacked(builder, arguments[1]), strict=True):
            setattr(work, name, count)
        return work._getvalue()

    return _WORK(request, counts), generate


gather: Any = intrinsic(_gather)
