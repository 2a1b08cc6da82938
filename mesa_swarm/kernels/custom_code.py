"""Machine code of custom functions on disk: found by all that it depends on, so that it cannot be stale.

Numba's own cache finds code by the file of a function, and so does not notice when what that calls, or a value that it
uses, has changed. Here the name of a file is a digest of the function's bytecode and of the values that it uses. A
function that uses anything else than numbers, texts, arrays, NumPy, and compiled functions of mesa_swarm is not stored.
"""

import builtins
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import blake2b
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np

from mesa_swarm.base.errors import shortened
from mesa_swarm.kernels.code_files import StoredCode, list_folders, time_of_change
from mesa_swarm.kernels.compiled import FUNCTIONS

# Within the folders of machine code.
FOLDER = "custom"
# Every change of a function leaves code behind, about 100 kB: that of the last few is enough.
MOST_STORED = 300
# Larger arrays are not worth reading.
LARGEST_ARRAY = 10_000
# What is the same as long as the versions are.
CONSTANT = ("builtins", "math", "numpy")
CONSTANT_MODULES = (math, np)
VERSIONS = (sys.version, numba.__version__, np.__version__)


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
        description = repr((VERSIONS, _function(function), _value(more)))
    except Exception:  # an object of a user's may raise anything
        return None
    return blake2b(description.encode("utf-8", "backslashreplace"), digest_size=16).hexdigest()


def _function(function: FunctionType) -> Any:
    """Return what a function does as a plain value."""
    defaults = function.__defaults__, tuple((function.__kwdefaults__ or {}).items())
    return _code(function.__code__), _value(defaults), [(name, _value(value)) for name, value in _used_by(function)]


def _code(code: CodeType) -> Any:
    constants = [_code(constant) if isinstance(constant, CodeType) else _value(constant) for constant in code.co_consts]
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    more = code.co_argcount, code.co_kwonlyargcount, code.co_flags, code.co_exceptiontable
    return code.co_code, constants, names, more


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
    """Return the names that a code may look up in its module, attributes among them."""
    inner = [name for constant in code.co_consts if isinstance(constant, CodeType) for name in _names_in(constant)]
    return [*code.co_names, *inner]


def _value(value: Any) -> Any:
    """Return a value as a plain one that differs whenever machine code may."""
    kind = type(value)
    if value is None or value is Ellipsis or kind in (bool, int, float, complex, str, bytes):
        return kind.__name__, repr(value)
    if isinstance(value, np.generic):
        return str(value.dtype), value.tobytes()
    if kind in (tuple, list):
        return kind.__name__, [_value(part) for part in value]
    if kind is np.ndarray and value.dtype.kind in "biuf" and value.size <= LARGEST_ARRAY:
        return value.dtype.str, value.shape, value.strides, value.tobytes()
    return _by_name(value)


def _by_name(value: Any) -> Any:
    """Return the name of what never changes, and of the package's functions, after whose sources the folder is named.

    Other compiled functions are refused: in the code that calls them they have names that others may have.
    """
    home = getattr(value, "__module__", None) or ""
    if isinstance(value, ModuleType) and value in CONSTANT_MODULES:
        return value.__name__
    if isinstance(value, np.ufunc):
        return "numpy", value.__name__
    if home.partition(".")[0] in CONSTANT and isinstance(value, (type, BuiltinFunctionType, FunctionType)):
        return home, value.__qualname__
    function = getattr(value, "py_func", value)
    if isinstance(function, FunctionType) and function in FUNCTIONS:
        return home, function.__qualname__
    raise UnknownValueError(shortened(value))


class CustomCode(StoredCode):
    """The machine code of a function with a digest, for Numba to load and to store."""

    def __init__(self, function: FunctionType, digest: str, accepts: Callable[[], bool]) -> None:
        super().__init__(function, f"{FOLDER}/{digest}", accepts=accepts)
        self._digest = digest

    def _index_key(self, sig: Any, codegen: Any) -> tuple:
        return sig, codegen.magic_tuple(), self._digest

    def save_overload(self, sig: Any, result: Any) -> None:
        """Store code; where that cannot be, it is compiled in each process."""
        with suppress(Exception):  # of types that cannot be pickled, and of `accepts`
            super().save_overload(sig, result)
            _drop_old()


def rename_function(function: FunctionType, digest: str | None) -> FunctionType:
    """Return a function under a name that no other has: in one process there may be code of several others."""
    if digest is None:
        return function
    code, place = function.__code__, function.__globals__
    copy = FunctionType(code, place, function.__name__, function.__defaults__, function.__closure__)
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__qualname__, copy.__module__ = f"{function.__qualname__}_{digest}", function.__module__
    return copy


def store_on_disk(dispatcher: Any, digest: str | None, accepts: Callable[[], bool] = lambda: True) -> Any:
    """Let Numba load and store the machine code of a custom function, unless its digest is None; return it.

    The function has to be one of `rename_function`. Code is stored if `accepts()` returns True once it is compiled.
    """
    if digest is not None:
        dispatcher._cache = CustomCode(dispatcher.py_func, digest, accepts)
    return dispatcher


def _drop_old() -> None:
    """Remove the oldest files beyond the limit."""
    files = sorted((list_folders()[-1] / FOLDER).glob("*.nbc"), key=time_of_change)
    for old in files[:-MOST_STORED]:
        with suppress(OSError):  # another process has removed it
            old.unlink()
