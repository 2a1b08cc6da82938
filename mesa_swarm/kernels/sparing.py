"""Numba's compiler without work that changes nothing, for functions of the package: a fifth of its time."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, cast

from numba.core.codegen import JITCodeLibrary
from numba.core.registry import cpu_target
from numba.core.targetconfig import TargetConfig


class Definitions:
    """A module of LLVM with the functions that it defines, without the many more that it only declares."""

    def __init__(self, module: Any) -> None:
        object.__setattr__(self, "_module", module)

    @property
    def functions(self) -> list[Any]:
        """The functions that have a body."""
        return [function for function in self._module.functions if not function.is_declaration]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._module, name, value)


class SparingLibrary(JITCodeLibrary):
    """Code that Numba compiles; it would set up the passes of LLVM for functions without a body as well."""

    def _optimize_functions(self, ll_module: Any) -> None:
        super()._optimize_functions(Definitions(ll_module))


def list_values(flags: Any) -> dict[str, Any]:
    """Return all values of flags, as Numba's method does option by option; flags are compared 100,000 times."""
    flags_class: Any = type(flags)
    return {**_list_defaults(flags_class), **flags._values}


@cache
def _list_defaults(flags_class: Any) -> dict[str, Any]:
    return {name: option.default for name, option in flags_class.options.items()}


def compile_sparingly(dispatcher: Any) -> None:
    """Let Numba do no more than is needed when it compiles this function, and whatever that calls."""
    compiler = dispatcher._compiler
    compile_core = compiler._compile_core

    def compile_here(*arguments: Any) -> Any:
        with sparing():
            return compile_core(*arguments)

    compiler._compile_core = compile_here


@contextmanager
def sparing() -> Iterator[None]:
    """Let Numba make `SparingLibrary` and call `list_values` meanwhile; it compiles in one thread at a time."""
    codegen, flags_class = cpu_target.target_context.codegen(), cast(Any, TargetConfig)
    former = codegen._library_class, flags_class.values
    codegen._library_class, flags_class.values = SparingLibrary, list_values
    try:
        yield
    finally:
        codegen._library_class, flags_class.values = former
