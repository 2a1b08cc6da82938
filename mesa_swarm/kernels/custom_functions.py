"""What a user's compiled functions call in place of `math.sin` and the like: the elementary functions of the package.

So a rule of a user computes the same bits on every machine as well. A pass of Numba's compiler exchanges them, of
numbers, and ``x ** y``; arrays keep NumPy's, and `math.tan` and others that are not in `kernels.elementary` those of
the C library.
"""

import math
import operator
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, cast

import numpy as np
from numba import njit, typeof
from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.dispatcher import Dispatcher
from numba.core.untyped_passes import InlineInlinables
from numba.extending import overload

from mesa_swarm.kernels import elementary
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.custom_code import rename_function
from mesa_swarm.kernels.digests import FUNCTIONS, digest_function, digest_source
from mesa_swarm.kernels.elementary import direction_of, exp, hypot, power, whole_power

# Names in `math`, and in NumPy.
UNARY = {"sin": "sin", "cos": "cos", "atan": "arctan", "exp": "exp", "log": "log", "log1p": "log1p", "expm1": "expm1"}
UNARY |= {"tanh": "tanh"}
BINARY = {"atan2": "arctan2", "hypot": "hypot"}


def exchange_unary(own: Callable, other: Callable) -> Callable:
    """Return what calls `own` of a number, and the `other` function of anything else, in compiled code."""

    def function(x: Any, out: Any = None) -> Any:
        return own(1.0 * x)

    def choose(x: Any, out: Any = None) -> Callable:
        return function if is_number(x) and is_left_out(out) else call_other_unary(other, out)

    overload(function)(choose)
    return function


def exchange_of_complex(of_complex: Callable, of_number: Callable, other: Callable) -> Callable:
    """Return what calls one function of a complex number, one of a real number, and the `other` of anything else."""

    def function(x: Any, out: Any = None) -> Any:
        return of_complex(x)

    def call_with_number(x: Any, out: Any = None) -> Any:
        return of_number(x)

    def choose(x: Any, out: Any = None) -> Callable:
        if not is_left_out(out):
            return call_other_unary(other, out)
        if isinstance(types.unliteral(x), types.Complex):
            return function
        return call_with_number if is_number(x) else call_other_unary(other, out)

    overload(function)(choose)
    return function


def call_other_unary(other: Callable, out: Any) -> Callable:
    """Return what calls a function of one argument, and of an array to write to if there is one."""

    def call_other(x: Any, out: Any = None) -> Any:
        return other(x)

    def write_other(x: Any, out: Any = None) -> Any:
        return other(x, out)

    return call_other if is_left_out(out) else write_other


def exchange_binary(own: Callable, other: Callable) -> Callable:
    """Return the same as `exchange_unary` for functions of two numbers."""

    def function(x: Any, y: Any, out: Any = None) -> Any:
        return own(1.0 * x, 1.0 * y)

    def call_other(x: Any, y: Any, out: Any = None) -> Any:
        return other(x, y)

    def write_other(x: Any, y: Any, out: Any = None) -> Any:
        return other(x, y, out)

    def choose(x: Any, y: Any, out: Any = None) -> Callable:
        if not is_left_out(out):
            return write_other
        return function if is_number(x) and is_number(y) else call_other

    overload(function)(choose)
    return function


def raise_number(x: Any, y: Any) -> Any:
    """Return x to the power y, in compiled code by the functions of the package if either is a real number."""
    return x**y


@overload(raise_number)
def _choose_power(x: Any, y: Any) -> Callable:
    def of_whole_number(x: Any, y: Any) -> Any:
        return whole_power(1.0 * x, int(y))

    def of_number(x: Any, y: Any) -> Any:
        return power(1.0 * x, 1.0 * y)

    def of_others(x: Any, y: Any) -> Any:
        return x**y

    if isinstance(types.unliteral(x), types.Float) and isinstance(types.unliteral(y), types.Integer):
        return of_whole_number
    is_real = types.Float in (type(types.unliteral(x)), type(types.unliteral(y)))
    return of_number if is_real and is_number(x) and is_number(y) else of_others


def raise_in_place(x: Any, y: Any) -> Any:
    """Return x to the power y; an array is changed in place, as by ``x **= y``."""
    x **= y
    return x


@overload(raise_in_place)
def _choose_power_in_place(x: Any, y: Any) -> Callable:
    def of_arrays(x: Any, y: Any) -> Any:
        x **= y
        return x

    def of_numbers(x: Any, y: Any) -> Any:
        return raise_number(x, y)

    return of_arrays if isinstance(x, types.Array) else of_numbers


def is_left_out(kind: Any) -> bool:
    """Return whether a type of Numba's is that of an argument that was not given."""
    return kind is None or isinstance(kind, (types.Omitted, types.NoneType))


@compiled
def magnitude_of(x: complex) -> float:
    """Return the magnitude of a complex number."""
    return hypot(x.real, x.imag)


@compiled
def exp_of_real(x: float) -> float:
    """Return e to the power of a number of any type."""
    return exp(1.0 * x)


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
    yield math.pow, exchange_binary(power, math.pow)
    yield np.exp, exchange_of_complex(exp_of_complex, exp_of_real, np.exp)
    for magnitude in (abs, np.abs):
        yield magnitude, exchange_of_complex(magnitude_of, magnitude, magnitude)


EXCHANGED = dict(_exchanged())
OPTIONS = ("boundscheck", "error_model", "fastmath")
# Code in these folders is not a user's.
OURS = str(Path(__file__).parents[1])
GALLERY = str(Path(__file__).parents[1] / "models")
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


def is_power(code: Any, expression: Any) -> bool:
    """Return whether an expression is ``x ** y`` or ``x **= y``, the exponent not a constant whole number."""
    if not isinstance(expression, ir.Expr) or expression.op not in ("binop", "inplace_binop"):
        return False
    if (expression.fn if expression.op == "binop" else expression.immutable_fn) is not operator.pow:
        return False
    try:
        return not isinstance(code.infer_constant(expression.rhs), int)
    except Exception:  # Numba's, of what is not a constant
        return True


def function_instead(value: Any) -> Callable | None:
    """Return which function is to be called in place of one, None for those that stay."""
    try:
        return EXCHANGED.get(value)
    except TypeError:  # a list, an array
        return None


def is_of_user(value: Any) -> bool:
    """Return whether a value is a compiled function of a user's."""
    return isinstance(value, Dispatcher) and value.py_func not in FUNCTIONS and not is_ours(value.py_func.__code__)


def is_ours(code: CodeType) -> bool:
    """Return whether code is the package's own, to which models of the gallery do not belong: they are as a user's."""
    file = code.co_filename
    return file.startswith(OURS) and not file.startswith(GALLERY)


@cache
def exchange_functions(function: Dispatcher) -> Dispatcher:
    """Return a compiled function of the user's, compiled again with the functions of the package.

    It has a name that no other has, since code that calls it may be stored.
    """
    plain = cast(FunctionType, function.py_func)
    own = rename_function(plain, digest_function(plain, VERSION))
    return njit(pipeline_class=CustomCompiler, **user_options(function))(own)


def user_options(function: Dispatcher) -> dict[str, Any]:
    """Return what compiled functions keep of the user's options."""
    return {name: function.targetoptions[name] for name in OPTIONS if name in function.targetoptions}


def call_power(block: Any, assignment: Any) -> None:
    """Let a function be called in place of an operator."""
    place, where = assignment.loc, block.body.index(assignment)
    function = ir.Var(block.scope, f"$power_{where}_{place.line}_{place.col or 0}", place)
    own = raise_number if assignment.value.op == "binop" else raise_in_place
    block.body.insert(where, ir.Assign(ir.Global(own.__name__, own, place), function, place))
    operands = assignment.value.lhs, assignment.value.rhs
    assignment.value = ir.Expr.call(function, operands, (), place)


@register_pass(mutates_CFG=False, analysis_only=False)
class _Exchange(FunctionPass):
    """Exchanges functions."""

    _name = "mesa_swarm_functions"

    def __init__(self) -> None:
        FunctionPass.__init__(self)  # which Numba declares abstract

    def run_pass(self, state: Any) -> bool:
        code, has_changed = state.func_ir, False
        for block in code.blocks.values():
            for assignment in list(block.find_insts(ir.Assign)):
                if is_power(code, assignment.value):
                    call_power(block, assignment)
                    has_changed = True
                    continue
                value = constant_of(code, assignment)
                function: Any = exchange_functions(value) if is_of_user(value) else function_instead(value)
                if function is not None:
                    assignment.value, has_changed = ir.Global("exchanged", function, assignment.loc), True
        return has_changed


class CustomCompiler(CompilerBase):
    """Numba's compiler with one more pass, before variables get their single assignments, for functions of a user."""

    added_pass: type[FunctionPass] = _Exchange

    def define_pipelines(self) -> list:
        """Return the usual passes, with one more."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(self.added_pass, InlineInlinables)
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


def returns_whole_number(compiled: Any, values: tuple) -> bool:
    """Return whether a compiled function returns a whole number, or whether something is true, for such values.

    Examples
    --------
    >>> returns_whole_number(compile_custom(lambda x: x > 1), (0.5,))
    True
    """
    kinds = tuple(map(typeof, values))
    compiled.compile(kinds)
    return isinstance(compiled.overloads[kinds].signature.return_type, (types.Integer, types.Boolean))
