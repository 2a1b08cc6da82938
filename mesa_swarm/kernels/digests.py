"""Digests of compiled functions: of all that their machine code depends on besides types, so that it cannot be stale.

Numba's own cache finds code by the file of a function, and so does not notice when what that calls, or a value that it
uses, has changed; and it makes all code of a file anew when a comment in it has. Here the name of a file is a digest of
the function's bytecode, of the values that it uses, and of the functions that it calls, of mesa_swarm and compiled ones
of a user's. A function that uses anything else than numbers, texts, arrays, NumPy, Numba's own and these functions has
no digest.
"""

import builtins
import dis
import math
import sys
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from hashlib import blake2b
from inspect import CO_NEWLOCALS
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.types import Type
from numba.extending import intrinsic

from mesa_swarm.base.errors import shortened
from mesa_swarm.kernels.type_names import declared_type, name_type

# The functions of the package that are compiled by `kernels.compiled`.
FUNCTIONS: set[Callable[..., Any]] = set()
# Larger arrays are not worth reading.
LARGEST_ARRAY = 10_000
# What is the same as long as the versions are.
CONSTANT = ("builtins", "math", "numpy", "numba")
CONSTANT_MODULES = (math, np)
LOOKING_UP = ("LOAD_GLOBAL", "LOAD_NAME", "IMPORT_NAME")
# What Python's and Numba's versions decide is in the name of the machine, too. Numba asks for no more of NumPy's.
VERSIONS = (sys.version_info[:2], numba.__version__, np.__version__.split(".")[:2])
Intrinsic = type(intrinsic(lambda typing_context: None))


class UnknownValueError(Exception):
    """A function uses something of which it is not known when it changes."""


def digest_function(function: FunctionType, *more: Any) -> str | None:
    """Return a digest of a function with all that its machine code depends on besides types, None if that is not known.

    Parameters
    ----------
    function : function
    more
        Further plain values.

    Examples
    --------
    >>> near = 3
    >>> first = digest_function(lambda x: x + near)
    >>> near = 4
    >>> first == digest_function(lambda x: x + near)
    False
    >>> print(digest_function(lambda x: x + open("file")))
    None
    """
    try:
        called: dict[FunctionType, None] = {}
        description = repr((VERSIONS, _describe(function, called), _value(more, called), _describe_called(called)))
    except Exception:  # an object of a user's may raise anything
        return None
    return blake2b(description.encode("utf-8", "backslashreplace"), digest_size=16).hexdigest()


def _describe_called(called: dict[FunctionType, None]) -> list[tuple[str, str]]:
    """Return names and descriptions of functions of the package, and of those that they call in turn."""
    descriptions: dict[FunctionType, str] = {}
    waiting = [*called]
    while waiting:
        function = waiting.pop()
        if function not in descriptions:
            descriptions[function], more = _describe_once(function)
            waiting += more
    return sorted((name_function(function), words) for function, words in descriptions.items())


@cache
def _describe_once(function: FunctionType) -> tuple[str, tuple[FunctionType, ...]]:
    called: dict[FunctionType, None] = {}
    return repr(_describe(function, called)), tuple(called)


def name_function(function: FunctionType) -> str:
    """Return the module and the name of a function."""
    return f"{function.__module__}.{function.__qualname__}"


def _describe(function: FunctionType, called: dict[FunctionType, None]) -> Any:
    """Return what a function does as a plain value, and note which functions of the package it calls."""
    defaults = function.__defaults__, tuple((function.__kwdefaults__ or {}).items())
    used = [(name, _value(value, called)) for name, value in _used_by(function)]
    return _code(function.__code__, called), _value(defaults, called), used


def _code(code: CodeType, called: dict[FunctionType, None]) -> Any:
    # The first constant of a function is its docstring, or None.
    texts = code.co_consts[1:] if code.co_flags & CO_NEWLOCALS and _has_docstring(code) else code.co_consts
    constants = [_code(part, called) if isinstance(part, CodeType) else _value(part, called) for part in texts]
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    more = code.co_argcount, code.co_kwonlyargcount, code.co_flags, code.co_exceptiontable
    return code.co_code, constants, names, more


def _has_docstring(code: CodeType) -> bool:
    return bool(code.co_consts) and isinstance(code.co_consts[0], str)


def _used_by(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield names and values that a function takes from around it and from its module."""
    cells = function.__closure__ or ()
    for name, cell in zip(function.__code__.co_freevars, cells, strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # it has no value yet
            raise UnknownValueError(name) from None
    for name in _names_in(function.__code__):
        if name in function.__globals__:
            yield name, function.__globals__[name]
        elif hasattr(builtins, name):
            yield name, getattr(builtins, name)


def _names_in(code: CodeType) -> list[str]:
    """Return the names that a code looks up in its module."""
    inner = [name for constant in code.co_consts if isinstance(constant, CodeType) for name in _names_in(constant)]
    looked_up = {step.argval: None for step in dis.get_instructions(code) if step.opname in LOOKING_UP}
    return [*looked_up, *inner]


def _value(value: Any, called: dict[FunctionType, None]) -> Any:
    """Return a value as a plain one that differs whenever machine code may."""
    kind = type(value)
    if value is None or value is Ellipsis or kind in (bool, int, float, complex, str, bytes):
        return kind.__name__, repr(value)
    if isinstance(value, np.generic):
        return str(value.dtype), value.tobytes()
    if isinstance(value, Enum):
        return kind.__qualname__, value.name, _value(value.value, called)
    if kind in (tuple, list):
        return kind.__name__, [_value(part, called) for part in value]
    if kind is np.ndarray and value.dtype.kind in "biuf" and value.size <= LARGEST_ARRAY:
        return value.dtype.str, value.shape, value.strides, value.tobytes()
    return _by_name(value, called)


def _by_name(value: Any, called: dict[FunctionType, None]) -> Any:
    """Return the name of what never changes, and of functions of the package, which are described besides.

    Compiled functions of a user's are described where they are used. `custom_functions` compiles them under names that
    no other has; otherwise they would have names, in the code that calls them, that others may have.
    """
    home = getattr(value, "__module__", None) or ""
    function = getattr(value, "py_func", value)
    if isinstance(function, FunctionType) and function in FUNCTIONS:
        called[function] = None
        return name_function(function)
    if isinstance(value, ModuleType) and value in CONSTANT_MODULES:
        return value.__name__
    if isinstance(value, np.ufunc):
        return "numpy", value.__name__
    if isinstance(value, Type):
        return name_type(value)
    if isinstance(value, Intrinsic):
        return value._defn.__qualname__, digest_source(value._defn.__code__.co_filename)
    return _name_constant(value, home, called)


def _name_constant(value: Any, home: str, called: dict[FunctionType, None]) -> tuple[Any, ...]:
    if isinstance(value, Dispatcher):  # one that calls itself ends in a RecursionError, and so has no digest
        options = sorted((name, repr(option)) for name, option in value.targetoptions.items())
        return value.py_func.__qualname__, options, _describe(value.py_func, called)
    if home.partition(".")[0] in CONSTANT and isinstance(value, (type, BuiltinFunctionType, FunctionType)):
        return home, value.__qualname__
    if isinstance(value, type) and hasattr(value, "_fields"):
        return home, value.__qualname__, value._fields, name_type(declared_type(value))
    raise UnknownValueError(shortened(value))


@cache
def digest_source(file: str) -> str:
    """Return a digest of a file with functions that write machine code themselves."""
    return blake2b(Path(file).read_bytes(), digest_size=16).hexdigest()
