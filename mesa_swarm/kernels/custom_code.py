"""Machine code of custom functions on disk: found by a digest of all that it depends on, or not stored."""

from collections.abc import Callable
from contextlib import suppress
from types import FunctionType
from typing import Any

from mesa_swarm.kernels.code_files import StoredCode, list_folders, time_of_change

# Within the folders of machine code.
FOLDER = "custom"
# Every change of a function leaves code behind, about 100 kB: that of the last few is enough.
MOST_STORED = 300


class CustomCode(StoredCode):
    """The machine code of a function with a digest, for Numba to load and to store."""

    def __init__(self, function: FunctionType, digest: str, accepts: Callable[[], bool]) -> None:
        super().__init__(function, f"{FOLDER}/{digest}", accepts=accepts)
        self.name = digest

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
