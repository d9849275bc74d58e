"""All that is Numba's: how a kernel is compiled, and the engine's arrays as one value.

A tuple of two dozen arrays, each of seven numbers, would take the compiler most of a minute.
"""

import ctypes
from typing import Any

import numpy as np
from numba import cfunc, njit, types
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

from pendpipe.dynamics.kernel import KINDS, Kernel
from pendpipe.dynamics.layout import ADDRESSES, COUNTS, FIELDS

# Numba gives these no types.
make_array: Any = arrayobj.make_array
populate_array: Any = arrayobj.populate_array
struct_proxy: Any = cgutils.create_struct_proxy
unpacked: Any = cgutils.unpack_tuple
lower_attributes: Any = lower_getattr_generic

_ITEM = 8
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
"""No reference counts (which forbids to allocate), and no exceptions of division."""
_VECTOR = types.Array(types.float64, 1, "C")
_MATRIX = types.Array(types.float64, 2, "C")
_NUMBERS: dict[Any, Any] = {
    ctypes.c_int64: types.int64,
    ctypes.c_double: types.float64,
    None: types.void,
}


def dispatcher(kernel: Kernel) -> Any:
    """Return a kernel as Numba's function, for other kernels: Python needs no entry to it."""
    make: Any = njit
    return make(**_OPTIONS, **kernel.options, no_cpython_wrapper=True, no_cfunc_wrapper=True)(
        kernel.function
    )


def compiled(kernel: Kernel) -> Any:
    """Compile a kernel as a function of C: each array as its address and its shape."""
    names, given, kinds = [], [], []
    for number, annotation in enumerate(kernel.kinds):
        kind, axes = KINDS[annotation]
        if axes == 0:
            names.append(f"x{number}")
            given.append(f"x{number}")
            kinds.append(_NUMBERS[kind])
            continue
        shape = [f"n{number}_{axis}" for axis in range(axes)]
        names += [f"x{number}", *shape]
        array = f"array_at(x{number}, ({', '.join(shape)},))"
        given.append(f"gather(x{number})" if annotation == "Work" else array)
        item: Any = types.float64 if kind == np.float64 else types.int64
        kinds += [types.CPointer(item), *axes * [types.int64]]  # type: ignore[no-untyped-call]
    scope = {"kernel": kernel, "array_at": array_at, "gather": gather}
    text = f"def entry({', '.join(names)}):\n    return kernel({', '.join(given)})"
    exec(text, scope)
    make: Any = cfunc(_NUMBERS[kernel.returns](*kinds), **_OPTIONS)
    return make(scope["entry"])


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: Any) -> Any:
    """Make the array of a kind and shape whose numbers begin at `data`."""
    result = make_array(kind)(context, builder)
    item = context.get_constant(types.intp, _ITEM)
    strides = [item]
    for count in reversed(shape[1:]):
        strides.insert(0, builder.mul(count, strides[0]))
    populate_array(
        result, data=data, shape=list(shape), strides=strides, itemsize=item, meminfo=None
    )
    return result._getvalue()


def _array_at(_typing: Any, pointer: Any, shape: Any) -> Any:
    """Return the array of a shape at `pointer` (`numba.carray` needs reference counts)."""
    kind = types.Array(pointer.dtype, shape.count, "C")

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _array(context, builder, kind, arguments[0], unpacked(builder, arguments[1]))

    return kind(pointer, shape), generate


array_at: Any = intrinsic(_array_at)


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


def _gather(_typing: Any, request: Any) -> Any:
    """Return the `layout.Work` of a request: addresses of arrays, and counts."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        work = struct_proxy(_WORK)(context, builder)
        for place, name in enumerate((*ADDRESSES, *COUNTS)):
            offset = context.get_constant(types.intp, place)
            number = builder.load(builder.gep(arguments[0], [offset]))
            if name in ADDRESSES:
                number = builder.inttoptr(number, context.get_value_type(_ADDRESS))
            setattr(work, name, number)
        return work._getvalue()

    return _WORK(request), generate


gather: Any = intrinsic(_gather)
