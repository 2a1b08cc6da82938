"""Waiting for a number that another thread writes, in compiled code, without holding the GIL; how many may work."""

import os
from typing import Any

from numba.core import types
from numba.extending import intrinsic

from mesa_swarm.kernels.compiled import compiled

# Multiplications between two looks, so that a thread that waits does not slow down the one beside it.
PAUSE = 16


def count_processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _address_of(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.bitcast(array.data, context.get_value_type(types.int64).as_pointer())


@intrinsic
def read_word(typing: Any, word: Any) -> Any:
    """Read the first number of an array as another thread has written it last."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address_of(context, builder, signature, arguments)
        return builder.load_atomic(address, "acquire", 8)

    return types.int64(word), code


@intrinsic
def write_word(typing: Any, word: Any, value: Any) -> Any:
    """Write the first number of an array, so that a thread that reads it sees what was written before."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address_of(context, builder, signature, arguments)
        builder.store_atomic(arguments[1], address, "release", 8)
        return context.get_dummy_value()

    return types.none(word, types.int64), code


@intrinsic
def swap_word(typing: Any, word: Any, before: Any, after: Any) -> Any:
    """Write the first number of an array if it is what it was before, and return whether it was."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address_of(context, builder, signature, arguments)
        pair = builder.cmpxchg(address, arguments[1], arguments[2], "acq_rel", "acquire")
        return builder.zext(builder.extract_value(pair, 1), context.get_value_type(types.boolean))

    return types.boolean(word, types.int64, types.int64), code


@intrinsic
def add_to_word(typing: Any, word: Any, number: Any) -> Any:
    """Add to the first number of an array at once, and return what it was."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address_of(context, builder, signature, arguments)
        return builder.atomic_rmw("add", address, arguments[1], "acq_rel")

    return types.int64(word, types.int64), code


@compiled(nogil=True)
def wait_while(word, value, looks):
    """Look at a word until it differs from a value, at most so often, and return what it is."""
    busy = 1
    for _ in range(looks):
        content = read_word(word)
        if content != value:
            return content
        for _ in range(PAUSE):
            busy = busy * 3 + value
    # Of use only so that no compiler leaves the pause out.
    return read_word(word) if busy != 0 else value
