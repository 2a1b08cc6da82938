"""The one way in which mesa_swarm compiles: Numba without fast-math, cached on disk, never stale."""

from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path

from numba import config, njit

PACKAGE = Path(__file__).resolve().parent.parent


# The floors that hold compiled functions.
FLOORS = ("geometry", "robots", "physics", "control", "fire", "learning")


def _stamp() -> str:
    """Return a name for this state of the compiled floors' sources."""
    digest = blake2b(digest_size=8)
    for path in sorted(path for floor in FLOORS for path in (PACKAGE / floor).glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


# Numba notices a change of the file that holds a compiled function, but not of the files whose functions
# that one calls. A cache folder of its own for each state of the sources cannot go stale.
_CACHE = Path(config.CACHE_DIR or PACKAGE / "__pycache__") / f"kernels-{_stamp()}"


def compiled(function: Callable) -> Callable:
    """Compile `function` when it is first called, and keep the machine code on disk.

    Examples
    --------
    >>> @compiled
    ... def twice(x):
    ...     return 2 * x
    >>> twice(21)
    42
    """
    asked = config.CACHE_DIR
    config.CACHE_DIR = str(_CACHE)
    try:
        return njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # no folder can be written to, or the source is not in a file
        return njit(error_model="numpy")(function)
    finally:
        config.CACHE_DIR = asked
