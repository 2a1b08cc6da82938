"""How busy this machine is, and with which processes, read from /proc."""

import os
import time
from pathlib import Path

import numpy as np

TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
# What `slowness` measures, in seconds, where the targets were met.
USUAL = 0.037


class Watch:
    """Processor time from now on, in seconds: of this process and all that it started, and of all processes."""

    def __init__(self) -> None:
        self._own, (self._busy, self._all) = own_seconds(), seconds()

    def others(self) -> float:
        """Return the share of the processors that others took."""
        busy, everything = seconds()
        others = (busy - self._busy) - sum(self.own().values())
        return max(0.0, others / (everything - self._all))

    def own(self) -> dict[int, float]:
        """Return what each process of this run took, by its id."""
        return {process: took - self._own.get(process, 0.0) for process, took in own_seconds().items()}


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


def seconds() -> tuple[float, float]:
    """Return how long all processors together were busy, and how long they were there."""
    user, nice, system, idle, waiting, *others = map(int, Path("/proc/stat").read_text().split("\n")[0].split()[1:9])
    busy = user + nice + system + sum(others)
    return busy / TICKS, (busy + idle + waiting) / TICKS


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
