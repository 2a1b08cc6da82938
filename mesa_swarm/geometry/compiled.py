"""The one way in which mesa_swarm compiles: Numba without fast-math, cached on disk, never stale."""

import re
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import Any

from numba import njit, typeof

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.geometry.apart import inherit_reloads, keep_apart
from mesa_swarm.geometry.code_files import PACKAGE, StoredCode, settings

if settings.DISABLE_JIT:
    raise InvalidValueError(
        "Numba's compiler is switched off by NUMBA_DISABLE_JIT, and mesa_swarm does not work without it; unset the "
        "variable: to go through a compiled function line by line, call its py_func"
    )
# Of the name of a file.
LONGEST_STEM = 100
# The functions of the package that are compiled in this way.
FUNCTIONS: set[Callable[..., Any]] = set()


def compiled(function: Callable[..., Any] | None = None, *, nogil: bool = False, apart: bool = False) -> Any:
    """Compile `function` when it is first called, and store the machine code on disk.

    To a type checker the result is Any: Numba infers the types, and `py_func` is there besides the call. With `nogil`
    other threads run meanwhile: for functions that take long, on arrays that no other thread touches.

    Examples
    --------
    >>> @compiled
    ... def twice(x):
    ...     return 2 * x
    >>> twice(21)
    42
    """
    if function is None:
        return partial(compiled, nogil=nogil, apart=apart)
    result: Any = njit(error_model="numpy", nogil=nogil)(function)
    if f"{function.__module__}.".startswith(f"{PACKAGE.name}."):
        FUNCTIONS.add(function)
        result._cache = StoredCode(function, stem_of(function))
    else:
        with suppress(OSError):  # its source is not in a file
            result._cache = StoredCode(function, *_described(function))
    inherit_reloads(result)
    if apart:
        keep_apart(result)
    return result


def _described(function: Callable[..., Any]) -> tuple[str, str]:
    """Return a name of a function of another package, and what its code depends on besides types."""
    code = function.__code__
    source = Path(code.co_filename)
    name = re.sub(r"[^\w.]", "", f"{source.stem}.{function.__qualname__}")
    return name[-LONGEST_STEM:], f"{code.co_firstlineno} {blake2b(source.read_bytes()).hexdigest()}"


def stem_of(function: Callable[..., Any]) -> str:
    """Return the name of a function of the package, as in `geometry/needed.json` and in names of files."""
    return f"{function.__module__.removeprefix(f'{PACKAGE.name}.')}.{function.__qualname__}"


def custom_compiled(function: Callable[..., Any]) -> Any:
    """Compile a user's function when it is first called; it releases the GIL and is not stored on disk.

    Bounds are checked: an index too large would otherwise read another robot's memory.

    Examples
    --------
    >>> custom_compiled(lambda x: 2 * x)(21)
    42
    """
    return njit(error_model="numpy", boundscheck=True, nogil=True)(function)


def is_refused(compiled: Any, values: tuple) -> bool:
    """Return whether Numba refuses to compile a function for these values; else an error is one of the function."""
    try:
        compiled.compile(tuple(map(typeof, values)))
    except Exception:  # Numba's own code raises ordinary errors too
        return True
    return False
