"""Compiled functions that others call where they are, instead of taking them in.

Numba copies the machine code of every function into those that call it, and optimises it again there: with functions
that call each other over several levels, compiling takes a third longer. Of a function that is `apart` there is
one copy, which callers find by its name; so each is compiled once. For large functions that are called a few times in a
step: a call takes some tens of nanoseconds, and nothing of it is optimised together with its caller.
"""

from dataclasses import dataclass
from hashlib import blake2b
from importlib import import_module
from typing import Any

from numba.core import cgutils
from numba.core.codegen import ll
from numba.core.imputils import fix_returning_optional, impl_ret_new_ref


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


def _call_by_name(name: str, described: Any, reload: Reload) -> Any:
    """Return what Numba writes where a function is called: Numba's own code for this, with another name."""

    def implementation(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = context.call_conv.get_function_type(described.restype, described.argtypes)
        function = cgutils.get_or_insert_function(builder.module, kind, name)
        context.active_code_library._reload_init.add(reload)
        status, value = context.call_conv.call_function(builder, function, described.restype, described.argtypes, args)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        value = fix_returning_optional(context, builder, sig, status, value)
        return impl_ret_new_ref(context, builder, described.restype, value)

    implementation.signature = described.argtypes  # type: ignore[attr-defined]
    implementation.libs = ()  # type: ignore[attr-defined]
    return implementation
