"""How much is tested in the time that there is, and how long work may take on machines that are slower than usual."""

import gc
import os
import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from support.machine import slowness


def in_time(amount):
    """Return fewer of something on a machine that `.ci/run` has found to be slower than usual, at least a tenth."""
    return max(amount // 10, int(amount / max(1.0, float(os.environ.get("MESA_SWARM_SLOWNESS", "1")))))


def is_out_of_time():
    """Whether slow tests that have not begun are left out, as `.ci/run` requires when its time is over."""
    return time.time() > float(os.environ.get("MESA_SWARM_SLOW_UNTIL", "inf"))


def shuffle_files(items: list, order: str | None) -> None:
    """Arrange tests in place, file by file, in an order drawn from a text, so that each text has other files first."""
    if order is None:
        return
    files = list(dict.fromkeys(item.path for item in items))
    random.Random(order).shuffle(files)
    rank = {path: i for i, path in enumerate(files)}
    items.sort(key=lambda item: rank[item.path])


def processor_seconds(work: Callable[[], object]) -> float:
    """Return how much processor time this process takes for some work."""
    begun = time.process_time()
    work()
    return time.process_time() - begun


@contextmanager
def work_within(seconds: float, of: str = "") -> Iterator[None]:
    """Fail if what is done within takes more processor time than this, on a processor as fast as usual.

    Wall-clock time would measure the machine's other users rather than the work. No garbage is collected meanwhile:
    how long that takes depends on what other tests have left.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    begun = time.process_time()
    try:
        yield
    finally:
        used = time.process_time() - begun
        if was_enabled:
            gc.enable()
        slow = 1.0 if used <= seconds else max(slowness() for _ in range(5))
        assert used <= seconds * slow, f"{used:.2f} s on a processor {slow:.1f} times slower than usual {of}"
