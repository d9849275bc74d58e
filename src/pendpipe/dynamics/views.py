"""Arrays made of bare memory, for the engine: Numba's own ways to them count references."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic
from numba.np import arrayobj

# Numba gives these no types.
make_array: Any = arrayobj.make_array
populate_array: Any = arrayobj.populate_array

_ITEM = 8
_INTEGERS = types.Array(types.int64, 1, "C")
_VECTOR = types.Array(types.float64, 1, "C")
_MATRIX = types.Array(types.float64, 2, "C")


def _vector(_typing: Any, pointer: Any, size: Any) -> Any:
    """Return the array of `size` numbers at `pointer`."""
    kind = _INTEGERS if pointer.dtype == types.int64 else _VECTOR

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        result = make_array(kind)(context, builder)
        item = context.get_constant(types.intp, _ITEM)
        populate_array(
            result, data=arguments[0], shape=[arguments[1]], strides=[item], itemsize=item,
            meminfo=None,
        )  # fmt: skip
        return result._getvalue()

    return kind(pointer, size), generate


def _matrix(_typing: Any, numbers: Any, rows: Any, columns: Any) -> Any:
    """Return the (rows, columns) array that begins where the array `numbers` begins."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = make_array(signature.args[0])(context, builder, arguments[0])
        result = make_array(_MATRIX)(context, builder)
        item = context.get_constant(types.intp, _ITEM)
        populate_array(
            result, data=source.data, shape=[arguments[1], arguments[2]],
            strides=[builder.mul(arguments[2], item), item], itemsize=item, meminfo=None,
        )  # fmt: skip
        return result._getvalue()

    return _MATRIX(numbers, rows, columns), generate


vector: Any = intrinsic(_vector)
matrix: Any = intrinsic(_matrix)
