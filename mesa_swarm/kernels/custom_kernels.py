"""Kernels of functions of arrays that users write: of one signature, and a block made for what they take."""

from collections.abc import Mapping
from hashlib import blake2b
from types import FunctionType
from typing import Annotated, Any, NamedTuple

import numpy as np
from numba import njit, typeof

from mesa_swarm.kernels.block import SIGNATURE, unpack
from mesa_swarm.kernels.custom_code import rename_function, store_on_disk
from mesa_swarm.kernels.custom_functions import VERSION, compile_custom
from mesa_swarm.kernels.digests import digest_function
from mesa_swarm.kernels.draws import Stream, draw_number
from mesa_swarm.kernels.type_names import name_type

# What a function may take besides what a block holds: the number of the step, a number that is drawn in each, and from
# where to draw more.
STEP, CHANCE, STREAM = "step", "chance", "stream"
# The code that a kernel returns where the function has raised an error.
FAILED = 1
TEXT = """
def kernel(block, step, first, last):
    given = unpack(block, Arrays)
    try:
        function({arguments})
    except Exception:
        return {failed}
    return 0
"""
# Of a function that returns a number: it is measured again in the first step after those that `every` divides, where
# `noted` has the one for which it was measured last, and stays in its place of `out` until then.
MEASURE = """
def kernel(block, step, first, last):
    given = unpack(block, Arrays)
    due = step - step % given.given_every
    if due == given.given_noted[given.given_slot]:
        return 0
    try:
        given.given_out[given.given_slot] = function({arguments})
    except Exception:
        return {failed}
    given.given_noted[given.given_slot] = due
    return 0
"""


class CustomKernel(NamedTuple):
    """A compiled function of a user's as a kernel, and the class of its block; or why Numba refuses it."""

    code: Any
    arrays: Any
    problem: str = ""


_MADE: dict[tuple, CustomKernel] = {}


def kernel_of_function(
    function: FunctionType, takes: tuple[str, ...], values: Mapping[str, Any], text: str = TEXT
) -> CustomKernel:
    """Return the kernel of a function of these arrays and numbers, made once for their types.

    Parameters
    ----------
    function : function
    takes : tuple of str
        The names of its parameters.
    values : dict
        Arrays in C order and numbers, by names of parameters other than `step`, `chance` and `stream`; the block holds
        them in this order, and last a `Stream`.
    text : str
        What the kernel is, `TEXT` or `MEASURE`; of the latter the values are also out, noted, slot and every.
    """
    # Numba takes some names for methods of arrays, such as view.
    fields = [(f"given_{name}", _annotation(value)) for name, value in values.items()]
    key = function, takes, tuple((name, str(kind)) for name, kind in fields), text
    if key not in _MADE:
        _MADE[key] = _make(function, takes, fields, text)
    return _MADE[key]


def _make(function: FunctionType, takes: tuple[str, ...], fields: list[tuple[str, Any]], text: str) -> CustomKernel:
    arrays: Any = NamedTuple("Arrays", [*fields, ("stream_of_chance", Stream)])  # type: ignore[misc]
    special = {STEP: "step", CHANCE: "draw_number(given.stream_of_chance)", STREAM: "given.stream_of_chance"}
    arguments = ", ".join(special.get(name, f"given.given_{name}") for name in takes)
    of_function = digest_function(function, VERSION)
    words = f"{of_function} {takes} {[(name, str(kind)) for name, kind in fields]} {text}"
    digest = of_function and blake2b(words.encode(), digest_size=16).hexdigest()
    own = store_on_disk(compile_custom(rename_function(function, of_function)), of_function)
    space = {"__name__": __name__, "unpack": unpack, "Arrays": arrays, "function": own, "draw_number": draw_number}
    exec(text.format(arguments=arguments, failed=FAILED), space)
    kernel = njit(error_model="numpy", boundscheck=True, nogil=True)(rename_function(space["kernel"], digest))
    code: Any = store_on_disk(kernel, digest)
    try:
        code.compile(SIGNATURE)
    except Exception as error:  # Numba's own code raises ordinary errors too
        return CustomKernel(None, arrays, str(error) or type(error).__name__)
    return CustomKernel(code, arrays)


def _annotation(value: Any) -> Any:
    return Annotated[np.ndarray, name_type(typeof(value))] if isinstance(value, np.ndarray) else type(value)
