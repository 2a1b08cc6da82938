"""Asking for memory before it is needed: rows of columns in an order that no processor foresees.

What is read and written stays the same; where there is little of it, all is in caches, and asking costs more than it
saves: see `FEWEST_ROWS`.
"""

from functools import partial
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.cgutils import ir
from numba.extending import intrinsic

# The columns of fewer robots are in the caches of a processor.
FEWEST_ROWS = 16_384
# Of LLVM's `prefetch`: that something is read or written, that it stays in all caches, that it is not code.
READ, WRITE, KEEP, NO_CODE = 0, 1, 3, 1


def _write_prefetch(purpose: int, context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    stride, *_ = cgutils.unpack_tuple(builder, array.strides)
    place = builder.add(builder.ptrtoint(array.data, ir.IntType(64)), builder.mul(stride, arguments[1]))
    pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    builder.call(function, [builder.inttoptr(place, pointer), *(number(word) for word in (purpose, KEEP, NO_CODE))])
    return context.get_dummy_value()


@intrinsic
def fetch_to_read(typing_context: Any, array: Any, row: Any) -> Any:
    """Ask for a row of an array that will be read, also beyond its end; for compiled functions."""
    return types.none(array, types.int64), partial(_write_prefetch, READ)


@intrinsic
def fetch_to_write(typing_context: Any, array: Any, row: Any) -> Any:
    """Ask for a row of an array that will be written, likewise."""
    return types.none(array, types.int64), partial(_write_prefetch, WRITE)
