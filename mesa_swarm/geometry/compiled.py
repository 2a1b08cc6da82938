"""The one way in which mesa_swarm compiles: Numba without fast-math, cached on disk, never stale."""

from collections.abc import Callable
from functools import partial
from hashlib import blake2b
from pathlib import Path
from shutil import rmtree
from typing import Any

import numba
from numba import njit, typeof
from numba.core.caching import IndexDataCacheFile

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.geometry.apart import inherit_reloads, keep_apart

# Numba finds its settings when it is imported, where no type checker sees them.
settings: Any = numba.config
if settings.DISABLE_JIT:
    raise InvalidValueError(
        "Numba's compiler is switched off by NUMBA_DISABLE_JIT, and mesa_swarm does not work without it; unset the "
        "variable: to go through a compiled function line by line, call its py_func"
    )
PACKAGE = Path(__file__).resolve().parent.parent
# The rooms that hold compiled functions.
FLOORS = ("geometry", "robots", "physics", "control", "fire", "learning", "environments")


def _stamp() -> str:
    """Return a name for this state of the sources that hold compiled functions."""
    digest = blake2b(digest_size=8)
    for path in sorted(path for floor in FLOORS for path in (PACKAGE / floor).glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


# Numba notices a change of the file that holds a compiled function, but not of the files whose functions
# that one calls. A separate cache folder for each state of the sources cannot go stale.
_CACHES = Path(settings.CACHE_DIR or PACKAGE / "__pycache__")
_CACHE = _CACHES / f"kernels-{_stamp()}"
# A line for each function and each set of types of which the machine code is there.
COMPILED = _CACHE / "compiled.txt"
# Every change of the sources leaves a cache behind: the last few are enough.
MOST_CACHES = 4


def _drop_old_caches() -> None:
    """Remove all but the newest caches, if there is to be a new one."""
    if _CACHE.exists():
        return
    for old in sorted(_CACHES.glob("kernels-*"), key=lambda path: path.stat().st_mtime)[: 1 - MOST_CACHES]:
        rmtree(old, ignore_errors=True)


_drop_old_caches()

# The functions of the package that are compiled in this way.
FUNCTIONS: set[Callable[..., Any]] = set()


class SeparateFiles(IndexDataCacheFile):
    """Numba's files of one function, each named after the types that its code is for.

    Numba counts them: of two processes that store code for different types at once, one would find the other's. Here
    at worst one is not in the index, and is compiled again.
    """

    def save(self, key: tuple, code: Any) -> None:
        """Write the machine code for a key, then the index."""
        name = self._index_name.replace(".nbi", f".{blake2b(repr(key).encode(), digest_size=6).hexdigest()}.nbc")
        self._save_data(name, code)
        self._save_index(self._load_index() | {key: name})


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
    if f"{function.__module__}.".startswith(f"{PACKAGE.name}."):
        FUNCTIONS.add(function)
    previous = settings.CACHE_DIR
    settings.CACHE_DIR = str(_CACHE)
    try:
        result: Any = njit(cache=True, error_model="numpy", nogil=nogil)(function)
        result._cache._cache_file.__class__ = SeparateFiles
        inherit_reloads(result)
        if apart:
            keep_apart(result)
        return result
    except RuntimeError:  # no folder can be written to, or the source is not in a file
        return njit(error_model="numpy", nogil=nogil)(function)
    finally:
        settings.CACHE_DIR = previous


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
