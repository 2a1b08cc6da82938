"""How long the runs of a notebook are."""

import os

# Set, it makes what notebooks show small: enough to see that every cell runs, too little to see what it is about.
VARIABLE = "MESA_SWARM_QUICK"


def sized(full: int, quick: int) -> int:
    """Return the full size of something, or the quick one where the environment asks for small runs.

    Parameters
    ----------
    full, quick : int
        Steps, seeds, robots: whatever takes time.

    Examples
    --------
    >>> sized(3_000, 30) in (3_000, 30)
    True
    """
    return quick if os.environ.get(VARIABLE, "") not in ("", "0") else full
