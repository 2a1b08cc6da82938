"""How much is searched on machines that are slower than usual, so that all tests end in time."""

import os
import time


def in_time(amount):
    """Return fewer of something on a machine that `.ci/run` has found to be slower than usual, at least a tenth."""
    return max(amount // 10, int(amount / max(1.0, float(os.environ.get("MESA_SWARM_SLOWNESS", "1")))))


def is_out_of_time():
    """Whether slow tests that have not begun are left out, as `.ci/run` asks for on a machine slower than usual."""
    return time.time() > float(os.environ.get("MESA_SWARM_SLOW_UNTIL", "inf"))
