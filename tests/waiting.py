"""Waiting for what another thread does."""

import threading
import time
from collections.abc import Callable

# A machine that is busy with other things takes long for a step; a test that passes does not wait.
PATIENCE = 90.0


def wait_until(condition: Callable[[], object], seconds: float = PATIENCE) -> None:
    """Return as soon as the condition holds.

    Raises
    ------
    AssertionError
        If it does not for so many seconds.
    """
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


def threads(*names: str) -> list[threading.Thread]:
    """Return the threads of these names that run."""
    return [thread for thread in threading.enumerate() if thread.name in names]
