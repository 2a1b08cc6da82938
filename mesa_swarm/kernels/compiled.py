"""The one way in which mesa_swarm compiles: Numba without fast-math, cached on disk, never stale.

Numba copies the machine code of every function into those that call it, and optimises it again there: with functions
that call each other over several levels, compiling takes a third longer. Of a function that is `apart` there is
one copy, which callers find by its name; so each is compiled once. For large functions that are called a few times in a
step: a call takes some tens of nanoseconds, and nothing of it is optimised together with its caller.
"""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import cgutils
from numba.core.codegen import ll
from numba.core.imputils import fix_returning_optional, impl_ret_new_ref

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.kernels.code_files import PACKAGE, StoredCode, settings
from mesa_swarm.kernels.digests import FUNCTIONS, digest_function, digest_source
from mesa_swarm.kernels.sparing import compile_sparingly


@dataclass(frozen=True, slots=True)
class Reload:
    """Makes a function that is apart known to the linker, before code that calls it is loaded from disk."""

    module: str
    name: str
    types: tuple[Any, ...]

    def __call__(self) -> None:
        """Load the function, or compile it."""
        getattr(import_module(self.module), self.name).compile(self.types)


def keep_apart(dispatcher: Any) -> None:
    """Let functions that call this one find it by its name from now on."""
    add = dispatcher.add_overload

    def add_apart(result: Any) -> None:
        add(result)
        name = _name_of(result)
        code = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
        ll.add_symbol(name, code)
        function = dispatcher.py_func
        reload = Reload(function.__module__, function.__name__, tuple(result.signature.args))
        implementations = dispatcher.targetctx._defns
        del implementations[result.entry_point]
        call = _call_by_name(name, result.fndesc, reload)
        implementations[result.entry_point].append(call, call.signature)

    dispatcher.add_overload = add_apart


def inherit_reloads(dispatcher: Any) -> None:
    """Let functions that take in this one know what it calls by name, also when it was loaded from disk."""
    add = dispatcher.add_overload

    def add_inheriting(result: Any) -> None:
        add(result)
        result.library._reload_init.update(result.reload_init or ())

    dispatcher.add_overload = add_inheriting


def _name_of(result: Any) -> str:
    """Return a name that is the same in every process, and another one for other types."""
    about = f"{result.fndesc.argtypes} {result.fndesc.restype}"
    digest = blake2b(about.encode(), digest_size=8).hexdigest()
    return f"{result.fndesc.modname}.{result.fndesc.qualname}.{digest}"


def _call_by_name(name: str, fndesc: Any, reload: Reload) -> Any:
    """Return what Numba writes where a function is called: Numba's own code for this, with another name."""

    def implementation(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = context.call_conv.get_function_type(fndesc.restype, fndesc.argtypes)
        function = cgutils.get_or_insert_function(builder.module, kind, name)
        context.active_code_library._reload_init.add(reload)
        status, value = context.call_conv.call_function(builder, function, fndesc.restype, fndesc.argtypes, args)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        value = fix_returning_optional(context, builder, sig, status, value)
        return impl_ret_new_ref(context, builder, fndesc.restype, value)

    implementation.signature = fndesc.argtypes  # type: ignore[attr-defined]
    implementation.libs = ()  # type: ignore[attr-defined]
    return implementation


if settings.DISABLE_JIT:
    raise InvalidValueError(
        "Numba's compiler is switched off by NUMBA_DISABLE_JIT, and mesa_swarm does not work without it; unset the "
        "variable: to go through a compiled function line by line, call its py_func"
    )
# Addresses are those of functions themselves: the form that C would call costs time and is called by none.
SPARED = {"no_cfunc_wrapper": True}
# Of the name of a file.
LONGEST_STEM = 100


def compiled(
    function: Callable[..., Any] | None = None, *, nogil: bool = False, apart: bool = False, inline: bool = False
) -> Any:
    """Compile `function` when it is first called, and store the machine code on disk.

    To a type checker the result is Any: Numba infers the types, and `py_func` is there besides the call. With `nogil`
    other threads run meanwhile: for functions that take long, on arrays that no other thread touches. With `inline` its
    code becomes part of each function that calls it: for those that are called often, once in each loop, with tuples of
    arrays, which take longer to pass on than to use.

    Examples
    --------
    >>> @compiled
    ... def twice(x):
    ...     return 2 * x
    >>> twice(21)
    42
    """
    if function is None:
        return partial(compiled, nogil=nogil, apart=apart, inline=inline)
    options: Any = {"error_model": "numpy", "nogil": nogil, "forceinline": inline} | SPARED
    result: Any = njit(**options)(function)
    compile_sparingly(result)
    if f"{function.__module__}.".startswith(f"{PACKAGE.name}."):
        FUNCTIONS.add(function)
        result._cache = StoredCode(function, stem_of(function), partial(_digest, function, nogil, apart, inline))
    else:
        with suppress(OSError):  # its source is not in a file
            stem, description = _describe_function(function)
            result._cache = StoredCode(function, stem, lambda: description)
    inherit_reloads(result)
    if apart:
        keep_apart(result)
    return result


def _digest(function: Any, *options: bool) -> str | None:
    return digest_function(function, *options, digest_source(__file__))


def _describe_function(function: Callable[..., Any]) -> tuple[str, str]:
    """Return a name of a function of another package, and what its code depends on besides types."""
    code = function.__code__
    source = Path(code.co_filename)
    name = re.sub(r"[^\w.]", "", f"{source.stem}.{function.__qualname__}")
    words = f"{code.co_firstlineno} ".encode() + source.read_bytes()
    return name[-LONGEST_STEM:], blake2b(words, digest_size=16).hexdigest()


def stem_of(function: Callable[..., Any]) -> str:
    """Return the name of a function of the package, as in `kernels/needed.json` and in names of files."""
    return f"{function.__module__.removeprefix(f'{PACKAGE.name}.')}.{function.__qualname__}"
