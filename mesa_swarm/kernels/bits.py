"""Bits of integers, which mark some of a group."""

from typing import Any

from numba import types
from numba.extending import intrinsic


@intrinsic
def lowest_bit(typing_context: Any, lanes: Any) -> Any:
    """Return the place of the lowest bit of an integer other than 0; for compiled functions."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(*values, context.get_constant(types.boolean, True))

    return types.int64(types.int64), code
