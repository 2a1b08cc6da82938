"""What a user's compiled functions call in place of `math.sin` and the like: the elementary functions of the package.

So a rule of a user computes the same bits on every machine as well. A pass of Numba's compiler exchanges them, of
numbers; arrays keep NumPy's, and `math.tan` and others that are not in `kernels.elementary` those of the C library.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numba import njit, typeof
from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.untyped_passes import InlineInlinables
from numba.extending import overload

from mesa_swarm.kernels import elementary
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.digests import digest_source
from mesa_swarm.kernels.elementary import direction_of, exp, hypot

# Names in `math`, and in NumPy.
UNARY = {"sin": "sin", "cos": "cos", "atan": "arctan", "exp": "exp", "log": "log", "log1p": "log1p", "expm1": "expm1"}
UNARY |= {"tanh": "tanh"}
BINARY = {"atan2": "arctan2", "hypot": "hypot"}


def exchange_unary(own: Callable, other: Callable) -> Callable:
    """Return what calls `own` of a number, and the `other` function of anything else, in compiled code."""

    def function(x: Any) -> Any:
        return own(float(x))

    def call_other(x: Any) -> Any:
        return other(x)

    def choose(x: Any) -> Callable:
        return function if is_number(x) else call_other

    overload(function)(choose)
    return function


def exchange_binary(own: Callable, other: Callable) -> Callable:
    """Return the same for functions of two numbers."""

    def function(x: Any, y: Any) -> Any:
        return own(float(x), float(y))

    def call_other(x: Any, y: Any) -> Any:
        return other(x, y)

    def choose(x: Any, y: Any) -> Callable:
        return function if is_number(x) and is_number(y) else call_other

    overload(function)(choose)
    return function


def exchange_of_complex(of_complex: Callable, of_number: Callable, other: Callable) -> Callable:
    """Return what calls one function of a complex number, one of a real number, and the `other` of anything else."""

    def function(x: Any) -> Any:
        return of_complex(x)

    def call_with_number(x: Any) -> Any:
        return of_number(x)

    def call_other(x: Any) -> Any:
        return other(x)

    def choose(x: Any) -> Callable:
        if isinstance(types.unliteral(x), types.Complex):
            return function
        return call_with_number if is_number(x) else call_other

    overload(function)(choose)
    return function


@compiled
def magnitude_of(x: complex) -> float:
    """Return the magnitude of a complex number."""
    return hypot(x.real, x.imag)


@compiled
def exp_of_real(x: float) -> float:
    """Return e to the power of a number of any type."""
    return exp(float(x))


@compiled
def exp_of_complex(x: complex) -> complex:
    """Return e to the power of a complex number."""
    cosine, sine = direction_of(x.imag)
    size = exp(x.real)
    return complex(size * cosine, size * sine)


def is_number(kind: Any) -> bool:
    """Return whether a type of Numba's is one of real numbers."""
    return isinstance(types.unliteral(kind), (types.Integer, types.Float, types.Boolean))


def _exchanged() -> Iterator[tuple[Callable, Callable]]:
    for names, exchange in ((UNARY, exchange_unary), (BINARY, exchange_binary)):
        for name, name_in_numpy in names.items():
            own = getattr(elementary, name)
            for other in (getattr(math, name), getattr(np, name_in_numpy)):
                yield other, exchange(own, other)
    yield np.exp, exchange_of_complex(exp_of_complex, exp_of_real, np.exp)
    for magnitude in (abs, np.abs):
        yield magnitude, exchange_of_complex(magnitude_of, magnitude, magnitude)


EXCHANGED = dict(_exchanged())
# Stored machine code of a user's functions depends on these.
VERSION = digest_source(elementary.__file__), digest_source(__file__)


def constant_of(code: Any, assignment: Any) -> Any:
    """Return what a name, or an attribute of a module, stands for in Numba's code; None if that is not a constant."""
    value = assignment.value
    if isinstance(value, (ir.Global, ir.FreeVar)):
        return value.value
    if not (isinstance(value, ir.Expr) and value.op == "getattr"):
        return None
    try:
        return code.infer_constant(assignment.target)
    except Exception:  # Numba's, of what is not a constant
        return None


def function_instead(value: Any) -> Callable | None:
    """Return which function is to be called in place of one, None for those that stay."""
    try:
        return EXCHANGED.get(value)
    except TypeError:  # a list, an array
        return None


@register_pass(mutates_CFG=False, analysis_only=False)
class _Exchange(FunctionPass):
    """Exchanges functions."""

    _name = "mesa_swarm_functions"

    def __init__(self) -> None:
        FunctionPass.__init__(self)  # which Numba declares abstract

    def run_pass(self, state: Any) -> bool:
        code, has_changed = state.func_ir, False
        for block in code.blocks.values():
            for assignment in block.find_insts(ir.Assign):
                function = function_instead(constant_of(code, assignment))
                if function is not None:
                    assignment.value, has_changed = ir.Global("exchanged", function, assignment.loc), True
        return has_changed


class CustomCompiler(CompilerBase):
    """Numba's compiler with this pass, for functions of a user."""

    def define_pipelines(self) -> list:
        """Return the usual passes, with one more."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_Exchange, InlineInlinables)
        passes.finalize()
        return [passes]


def compile_custom(function: Callable[..., Any]) -> Any:
    """Compile a user's function when it is first called; it releases the GIL and is not stored on disk.

    Bounds are checked: an index too large would otherwise read another robot's memory.

    Examples
    --------
    >>> compile_custom(lambda x: 2 * x)(21)
    42
    """
    return njit(error_model="numpy", boundscheck=True, nogil=True, pipeline_class=CustomCompiler)(function)


def is_refused(compiled: Any, values: tuple) -> bool:
    """Return whether Numba refuses to compile a function for these values; else an error is one of the function."""
    try:
        compiled.compile(tuple(map(typeof, values)))
    except Exception:  # Numba's own code raises ordinary errors too
        return True
    return False
