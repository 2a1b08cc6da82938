"""Waiting for what a process, a thread or a page does: the one place in which tests look at the time of day.

A deadline protects against a hang. It does not measure speed: a machine that is busy with other things takes long for a
step, and a test that passes hardly waits.
"""

import threading
import time
from collections.abc import Callable

# Kernels that are not in the cache take so long.
PATIENCE = 120.0


class Deadline:
    """A number of seconds from now on."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds

    @property
    def left(self) -> float:
        """Seconds that are left, not below 0."""
        return max(0.0, self._end - time.monotonic())


def comes_true(
    condition: Callable[[], object],
    seconds: float = PATIENCE,
    every: float = 0.01,
    pause: Callable[[float], object] = time.sleep,
) -> bool:
    """Return True as soon as the condition holds, False if it does not within this time.

    Parameters
    ----------
    condition : callable
    seconds : float
        Waited at most.
    every : float
        Seconds between two looks.
    pause : callable
        Waits for a number of seconds.
    """
    deadline = Deadline(seconds)
    while not condition():
        if not deadline.left:
            return False
        pause(every)
    return True


def wait_until(condition: Callable[[], object], seconds: float = PATIENCE, **how: object) -> None:
    """Return as soon as the condition holds; `how` as in `comes_true`.

    Raises
    ------
    AssertionError
        If it does not within this time.
    """
    assert comes_true(condition, seconds, **how), "waited in vain"


def threads(*names: str) -> list[threading.Thread]:
    """Return the threads of these names that run."""
    return [thread for thread in threading.enumerate() if thread.name in names]
