"""Child processes that share what is open."""

import os
import signal
from contextlib import contextmanager


@contextmanager
def forked():
    """Have a child that shares all open files and does nothing, as a worker started meanwhile does."""
    child = os.fork()
    if not child:
        signal.pause()
    try:
        yield child
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
