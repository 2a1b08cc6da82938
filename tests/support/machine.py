"""What our processes take of this machine, read from /proc, and how fast it is."""

import os
import time
from pathlib import Path

import numpy as np

TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
# What `slowness` measures, in seconds, where the targets were met.
USUAL = 0.037


class Watch:
    """Processor time from now on, in seconds, of this process and all that it started."""

    def __init__(self) -> None:
        self._before = own_seconds()

    def own(self) -> dict[int, float]:
        """Return what each process of this run took, by its id."""
        return {process: took - self._before.get(process, 0.0) for process, took in own_seconds().items()}


def slowness() -> float:
    """Return how many times slower than usual a processor is just now, at least 1: by small calls, as steps make them.

    A virtual machine's processors are not always equally fast, however little of them others in it take.
    """
    rows, kept = np.linspace(0, 1, 12).reshape(6, 2), {}
    used = time.process_time()
    for k in range(20_000):
        moved = rows.copy()
        moved += rows
        kept[k % 97] = moved[k % 6, 0]
        np.isfinite(moved).all()
    return max(1.0, (time.process_time() - used) / USUAL)


def own_seconds() -> dict[int, float]:
    parents, took = {}, {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rsplit(")", 1)[-1].split()
        except OSError:  # it has just ended
            continue
        process = int(entry.parent.name)
        parents[process], took[process] = int(fields[1]), (int(fields[11]) + int(fields[12])) / TICKS
    return {process: took[process] for process in parents if is_ours(process, parents)}


def is_ours(process: int, parents: dict[int, int]) -> bool:
    while process in parents and process != os.getpid():
        process = parents[process]
    return process == os.getpid()


if __name__ == "__main__":
    print(f"{min(slowness() for _ in range(5)):.1f}")
