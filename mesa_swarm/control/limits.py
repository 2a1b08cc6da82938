"""Limits of custom rules: how often their loops may run in a step, and which values their memory takes.

A compiled loop cannot be interrupted, not by Ctrl-C either: one without end would hang the process. So each iteration
of a loop, in a rule and in the functions that it calls, is counted: in compiled code by a pass of Numba's compiler, in
plain Python by a trace function. It is a count, not a time, so that a run is the same on every machine. Not counted is
what functions written in C do, such as ``sum(itertools.count())`` in a plain rule.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from operator import attrgetter
from types import FrameType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import cgutils, ir, ir_utils
from numba.core.analysis import compute_cfg_from_blocks
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.dispatcher import Dispatcher
from numba.core.errors import UnsupportedError
from numba.extending import intrinsic, overload
from numba.np.ufunc.dufunc import DUFunc
from numba.np.ufunc.gufunc import GUFunc

from mesa_swarm.control import chance
from mesa_swarm.control.chance import read_chance
from mesa_swarm.control.source import attributes_used, functions_used, operands, operations, values_used
from mesa_swarm.kernels import draws
from mesa_swarm.kernels.custom_functions import VERSION as VERSION_OF_FUNCTIONS
from mesa_swarm.kernels.custom_functions import (
    CustomCompiler,
    constant_of,
    function_instead,
    is_of_user,
    is_ours,
    user_options,
)
from mesa_swarm.kernels.digests import digest_source

MOST_LOOPS = 1_000_000
# Operations of which a function with loops has one.
LOOPS = {"FOR_ITER", "JUMP_BACKWARD", "JUMP_BACKWARD_NO_INTERRUPT"}
LOOPS |= {f"POP_JUMP_BACKWARD_IF_{what}" for what in ("TRUE", "FALSE", "NONE", "NOT_NONE")}
# Part of the digest by which compiled rules are stored: to be changed with what this file and `rule` add to them.
VERSION = 4, *VERSION_OF_FUNCTIONS, *map(digest_source, (chance.__file__, draws.__file__))
LARGEST_WHOLE = 2.0**63
GETATTR_ARGUMENTS = ("object", "name")


class LoopsError(Exception):
    """The loops of a rule ran too often: the line, and the name of the function that it is in."""


class _StopError(BaseException):
    """The same in plain Python, which no ``except Exception`` of a rule catches."""


class MemoryKindError(Exception):
    """A number of a rule's memory was set to what it cannot hold: its name, what it began as, and the value."""


# ---- in compiled code: a number in the module that robots, rules and their functions share

CELL = "mesa_swarm_loops_left"


def _cell(context: Any, builder: Any) -> Any:
    """Return the variable that holds how many iterations are left: one for all that is linked together."""
    if CELL in builder.module.globals:
        return builder.module.globals[CELL]
    kind = context.get_value_type(types.int64)
    cell = cgutils.add_global_variable(builder.module, kind, CELL)
    cell.linkage, cell.initializer = "weak", cgutils.get_null_value(kind)
    return cell


@intrinsic
def allow_loops(context: Any, count: Any) -> tuple[Any, Callable]:
    """Set how many iterations are left."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[0], _cell(context, builder))
        return context.get_dummy_value()

    return types.void(types.int64), generate


@intrinsic
def count_loop(context: Any) -> tuple[Any, Callable]:
    """Count an iteration, and return whether it was one too many."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        cell, none, one = _cell(context, builder), *(context.get_constant(types.int64, number) for number in (0, 1))
        remaining = builder.sub(builder.load(cell), one)
        builder.store(remaining, cell)
        return builder.icmp_signed("<", remaining, none)

    return types.boolean(), generate


def check_field_value(record: Any, name: str, value: Any) -> Any:
    """Return what a field of a record may be set to; compiled code calls it before each assignment."""
    return value


@overload(check_field_value, prefer_literal=True)
def _compiled_kept(record: Any, name: Any, value: Any) -> Callable | None:
    if not isinstance(name, types.StringLiteral):
        return None
    field = record.typeof(name.literal_value) if isinstance(record, types.Record) else None
    check, word = _check_for(field, types.unliteral(value)), name.literal_value

    def unchecked(record: Any, name: Any, value: Any) -> Any:
        return value

    def checked(record: Any, name: Any, value: Any) -> Any:
        fits, number = check(value)
        if not fits:
            raise MemoryKindError(word, number)
        return value

    return checked if check else unchecked


def check_item(array: Any, value: Any) -> Any:
    """Return what an item of an array may be set to; compiled code calls it before each assignment."""
    return value


@overload(check_item)
def _compiled_kept_item(array: Any, value: Any) -> Callable:
    check = _check_for(array.dtype if isinstance(array, types.NestedArray) else None, types.unliteral(value))

    def unchecked(array: Any, value: Any) -> Any:
        return value

    def checked(array: Any, value: Any) -> Any:
        fits, number = check(value)
        if not fits:
            raise MemoryKindError("", number)
        return value

    return checked if check else unchecked


def _check_for(field: Any, value: Any) -> Any:
    """Return a compiled function that checks a value for a field, None where any value of its type may be taken."""
    is_array = isinstance(value, types.Array)
    kind = value.dtype if is_array else value
    if isinstance(field, types.Integer) and isinstance(kind, types.Float):
        return are_whole if is_array else is_whole
    if isinstance(field, types.Boolean) and isinstance(kind, (types.Float, types.Integer)):
        return are_truths if is_array else is_truth
    return None


@njit
def is_whole(value: float) -> tuple[bool, float]:
    """Return whether a number is whole and not too large for an integer, and the number."""
    return value == np.floor(value) and abs(value) < LARGEST_WHOLE, float(value)


@njit
def is_truth(value: float) -> tuple[bool, float]:
    """Return whether a number is 0 or 1, and the number."""
    return value in (0, 1), float(value)


@njit
def are_whole(values: np.ndarray) -> tuple[bool, float]:
    """Return whether all numbers are whole and not too large for integers, and the first that is not."""
    for value in values.flat:
        if not is_whole(value)[0]:
            return False, float(value)
    return True, 0.0


@njit
def are_truths(values: np.ndarray) -> tuple[bool, float]:
    """Return whether all numbers are 0 or 1, and the first that is not."""
    for value in values.flat:
        if not is_truth(value)[0]:
            return False, float(value)
    return True, 0.0


@register_pass(mutates_CFG=True, analysis_only=False)
class _Limit(FunctionPass):
    """Counts the iterations of loops, checks what is assigned, and has the functions that are called do the same."""

    _name = "mesa_swarm_limits"

    def __init__(self) -> None:
        FunctionPass.__init__(self)  # which Numba declares abstract

    def run_pass(self, state: Any) -> bool:
        code = state.func_ir
        for block in code.blocks.values():
            block.body = [statement for old in block.body for statement in _limit_statement(code, block.scope, old)]
        loops = compute_cfg_from_blocks(code.blocks).loops()
        for loop in sorted(loops.values(), key=attrgetter("header")):
            line = min(statement.loc.line for label in loop.body for statement in code.blocks[label].body)
            _count_in(code, loop, (line, state.func_id.func.__name__))
        code._definitions = ir_utils.build_definitions(code.blocks)
        return True


class LimitedCompiler(CustomCompiler):
    """Numba's compiler with this pass, which exchanges functions as well."""

    added_pass = _Limit


def places_of_loops(function: FunctionType) -> list[tuple[str, int]]:
    """Return name and first line of the functions with loops that a rule reaches: compiled code names them."""
    loops = [part for part in functions_used(function) if operations(part) & LOOPS]
    return [(part.__name__, part.__code__.co_firstlineno) for part in loops]


def _count_in(code: Any, loop: Any, at: tuple[int, str]) -> None:
    """Lead all ways back to the beginning of a loop over a block that counts: either on, or to an error."""
    begin = code.blocks[loop.header]
    scope, place = begin.scope, begin.loc
    again, stop = (max(code.blocks) + more for more in (1, 2))
    counter, is_over = (scope.redefine(f"$limit_{word}", place) for word in ("counter", "over"))
    for label in loop.body:
        body = code.blocks[label].body
        body[-1] = _redirect(body[-1], loop.header, again)
    code.blocks[again], code.blocks[stop] = ir.Block(scope, place), ir.Block(scope, place)
    code.blocks[stop].body = [ir.StaticRaise(LoopsError, at, place)]
    code.blocks[again].body = [
        ir.Assign(ir.Global("count_loop", count_loop, place), counter, place),
        ir.Assign(ir.Expr.call(counter, [], (), place), is_over, place),
        ir.Branch(is_over, stop, loop.header, place),
    ]


def _redirect(last: Any, before: int, after: int) -> Any:
    """Return the last statement of a block with another block to go to instead of one."""
    if isinstance(last, ir.Jump) and last.target == before:
        return ir.Jump(after, last.loc)
    if isinstance(last, ir.Branch) and before in (last.truebr, last.falsebr):
        yes, no = (after if label == before else label for label in (last.truebr, last.falsebr))
        return ir.Branch(last.cond, yes, no, last.loc)
    return last


def _limit_statement(code: Any, scope: Any, old: Any) -> Iterator[Any]:
    """Yield the statements that take the place of one."""
    if isinstance(old, ir.SetAttr):
        name, value = scope.redefine("$limit_name", old.loc), scope.redefine("$limit_value", old.loc)
        yield ir.Assign(ir.Const(old.attr, old.loc), name, old.loc)
        yield from _call(scope, check_field_value, [old.target, name, old.value], value, old.loc)
        yield ir.SetAttr(old.target, old.attr, value, old.loc)
    elif isinstance(old, (ir.SetItem, ir.StaticSetItem)):
        value = scope.redefine("$limit_value", old.loc)
        yield from _call(scope, check_item, [old.target, old.value], value, old.loc)
        old.value = value
        yield old
    elif isinstance(old, ir.Assign) and _is_chance(code, old):
        raw = scope.redefine("$limit_chance", old.loc)
        yield ir.Assign(old.value, raw, old.loc)
        yield from _call(scope, read_chance, [raw], old.target, old.loc)
    elif isinstance(old, ir.Assign) and (functions := _functions_instead(constant_of(code, old))) is not None:
        yield ir.Assign(ir.Global("limited", functions, old.loc), old.target, old.loc)
    else:
        yield old


def _is_chance(code: Any, assignment: Any) -> bool:
    """Return whether a rule reads `chance` of something, which is `me` or an object of the user's."""
    value = assignment.value
    if not isinstance(value, ir.Expr):
        return False
    if value.op == "getattr" and value.attr == "chance":
        return constant_of(code, assignment) is None  # not a function of that name in a module
    if value.op != "call" or len(value.args) != len(GETATTR_ARGUMENTS):
        return False
    try:
        return code.infer_constant(value.func) is getattr and code.infer_constant(value.args[1]) == "chance"
    except Exception:  # Numba's, of what is not a constant
        return False


def _call(scope: Any, function: Callable, arguments: list, result: Any, place: Any) -> Iterator[Any]:
    variable = scope.redefine("$limit_function", place)
    yield ir.Assign(ir.Global(function.__name__, function, place), variable, place)
    yield ir.Assign(ir.Expr.call(variable, arguments, (), place), result, place)


def _functions_instead(value: Any) -> Any:
    """Return what is to be called in place of a function, None if nothing is."""
    return function_instead(value) or _limit_functions(value)


def _limit_functions(value: Any) -> Any:
    """Return compiled functions of the user's, also in a tuple, as they are within limits; None if there is none."""
    if isinstance(value, (DUFunc, GUFunc)):
        raise UnsupportedError(f"the loops of {value.__name__}, a compiled ufunc, cannot be counted")
    if isinstance(value, tuple):
        parts = [_limit_functions(part) for part in value]
        has_new = any(part is not None for part in parts)
        return tuple(old if new is None else new for old, new in zip(value, parts, strict=True)) if has_new else None
    return limit_loops(value) if is_of_user(value) else None


@cache
def limit_loops(function: Dispatcher) -> Dispatcher:
    """Return a compiled function of the user's, compiled again within limits."""
    return njit(pipeline_class=LimitedCompiler, **user_options(function))(function.py_func)


def calls_itself(function: FunctionType) -> str | None:
    """Return the name of a function that calls itself, also by way of others, among those that a rule calls.

    Compiled, it would end the process where the stack ends.
    """
    finished: set[FunctionType] = set()

    def visit(part: FunctionType, trail: tuple[FunctionType, ...]) -> str | None:
        if part in trail:
            return part.__name__
        if part in finished:
            return None
        finished.add(part)
        return next((name for callee in list_callees(part) if (name := visit(callee, (*trail, part)))), None)

    return visit(function, ())


def list_callees(function: FunctionType) -> list[FunctionType]:
    """Return the functions that a function may call, by a name or as an attribute of a module, as they were written."""
    attributes = operands(function, "LOAD_ATTR", "LOAD_METHOD")
    values = [value for _, value in values_used(function)]
    modules = [
        value for value in values if isinstance(value, ModuleType) and value.__name__.partition(".")[0] != "numpy"
    ]
    values += [getattr(module, name, None) for module in modules for name in attributes]
    functions = (getattr(value, "py_func", value) for value in values)
    return [value for value in functions if isinstance(value, FunctionType) and not _is_foreign(value)]


def _is_foreign(function: FunctionType) -> bool:
    """Return whether a function is of NumPy or the package, which both end."""
    return (function.__module__ or "").partition(".")[0] in ("math", "numpy") or is_ours(function.__code__)


# ---- in plain Python


class _Tracer:
    """A trace function that counts calls, and jumps back, which are the iterations of loops."""

    def __init__(self) -> None:
        self.calls = self.loops = MOST_LOOPS

    def __call__(self, frame: FrameType, event: str, argument: Any) -> Callable | None:
        """Begin to count in a function, unless it is the package's."""
        if event != "call" or is_ours(frame.f_code):
            return None
        self.calls -= 1
        self._check(frame)
        frame.f_trace_opcodes, frame.f_trace_lines = BY_OPERATION, not BY_OPERATION
        return self._within()

    def _within(self) -> Callable:
        """Return a trace function for one call of a function, which notes where it is."""
        last = -1

        def trace(frame: FrameType, event: str, argument: Any) -> Callable:
            nonlocal last
            if event in ("line", "opcode"):
                place = frame.f_lasti if BY_OPERATION else frame.f_lineno
                if place <= last:
                    self.loops -= 1
                    self._check(frame)
                last = place
            return trace

        return trace

    def _check(self, frame: FrameType) -> None:
        if self.calls < 0 or self.loops < 0:
            raise _StopError(frame.f_lineno, frame.f_code.co_name)


# Before Python 3.12 a loop in one line is not seen by lines.
BY_OPERATION = sys.version_info < (3, 12)


@contextmanager
def count_loops() -> Iterator[None]:
    """Count iterations of plain Python from here on; not under a debugger, which has a trace function of its own."""
    if sys.gettrace() is not None:
        yield
        return
    sys.settrace(_Tracer())
    try:
        yield
    except _StopError as stop:
        raise LoopsError(*stop.args) from None
    finally:
        sys.settrace(None)


def uncompile(function: FunctionType, copies: dict[FunctionType, FunctionType] | None = None) -> FunctionType:
    """Return a function in which compiled functions, whose loops could not be counted, are as they were written.

    `copies` has those that are made already: functions may call each other.
    """
    copies = {} if copies is None else copies
    if function in copies:
        return copies[function]
    compiled = {name: value for name, value in function.__globals__.items() if is_of_user(value)}
    plain_values = {name: compiled[name] for name, _ in values_used(function) if name in compiled}
    if not plain_values:
        return function
    around = {**function.__globals__}
    code, closure = function.__code__, function.__closure__
    copy = copies[function] = FunctionType(code, around, function.__name__, function.__defaults__, closure)
    copy.__kwdefaults__ = function.__kwdefaults__
    around.update({name: uncompile(value.py_func, copies) for name, value in plain_values.items()})
    return copy


def find_uncounted(function: FunctionType) -> list[str]:
    """Return the names of what a plain rule uses whose loops are not counted: compiled code that is not a function."""
    names = []
    for part in functions_used(function):
        names += [name for name, value in values_used(part) if not isinstance(value, Dispatcher) and _holds(value)]
        names += [name for name, value in attributes_used(part) if _holds(value)]
        names += [name for name, value in _list_imports(part) if _holds(value)]
        cells = part.__closure__ or ()
        names += [
            name for name, cell in zip(part.__code__.co_freevars, cells, strict=True) if is_of_user(_content(cell))
        ]
    return sorted(set(names))


def _holds(value: Any) -> bool:
    """Return whether a value is compiled code of the user's, or a container of such."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, (list, tuple, set)):
        return any(map(_holds, value))
    return isinstance(value, (DUFunc, GUFunc)) or is_of_user(value)


def _list_imports(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield what a function imports when it is called, of modules that are imported already."""
    modules = [sys.modules.get(name) for name in operands(function, "IMPORT_NAME")]
    for name in operands(function, "IMPORT_FROM"):
        yield from ((name, getattr(module, name)) for module in modules if hasattr(module, name))


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not yet assigned
        return None
