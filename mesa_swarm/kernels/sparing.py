"""Numba without work that changes nothing, while it compiles functions of the package: a tenth of its time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.registry import cpu_target


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


def compile_sparingly(dispatcher: Any) -> None:
    """Let Numba do no more than is needed when it compiles this function, and whatever that calls."""
    compiler = dispatcher._compiler
    compile_core = compiler._compile_core

    def compile_here(*arguments: Any) -> Any:
        with sparing_libraries():
            return compile_core(*arguments)

    compiler._compile_core = compile_here


@contextmanager
def sparing_libraries() -> Iterator[None]:
    """Let Numba make `SparingLibrary` meanwhile; it compiles in one thread at a time."""
    codegen = cpu_target.target_context.codegen()
    former = codegen._library_class
    codegen._library_class = SparingLibrary
    try:
        yield
    finally:
        codegen._library_class = former
