"""What work was done, as one line at the end, where a progress bar cannot be seen to move.

Apart from `progress`, because a command begins here, also one that draws no bar and needs no tqdm.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

from mesa_swarm.base.wording import quantity, time_text

# Whether bars are drawn even if standard error is not a terminal, for programs that read them.
always_drawn = False


@dataclass(frozen=True, slots=True)
class WorkDone:
    """Units of work that are done, of how many, from when on, and how many were done before."""

    unit: str
    done: int
    total: int
    before: int = 0

    def __str__(self) -> str:
        earlier = f" ({self.before:,} done before)" if self.before else ""
        return f"{self.done:,} of {quantity(self.total, self.unit.removesuffix('s'))}{earlier}"


def is_drawn() -> bool:
    """Return whether standard error shows bars that move: in a terminal and in a notebook.

    Examples
    --------
    >>> is_drawn()
    False
    """
    stream = sys.stderr
    return always_drawn or type(stream).__module__.startswith("ipykernel") or bool(stream and stream.isatty())


class WorkSummary:
    """Work by unit, in the order in which it was begun, and when the first of it began."""

    def __init__(self) -> None:
        self.works: dict[str, WorkDone] = {}
        self.begin: float | None = None

    def add(self, work: WorkDone, begin: float) -> None:
        """Add work to that of the same unit."""
        self.begin = begin if self.begin is None else min(self.begin, begin)
        earlier = self.works.get(work.unit, WorkDone(work.unit, 0, 0))
        counts = earlier.done + work.done, earlier.total + work.total, earlier.before + work.before
        self.works[work.unit] = WorkDone(work.unit, *counts)

    def print(self) -> None:
        """Print one line to standard error, if there was any work."""
        if self.begin is not None and sys.stderr is not None:
            works, seconds = ", ".join(map(str, self.works.values())), round(perf_counter() - self.begin, 1)
            print(f"{works} in {time_text(seconds)}", file=sys.stderr, flush=True)


# The summary of the command that is run, if one is.
_of_command: list[WorkSummary] = []


@contextmanager
def summarise_work() -> Iterator[None]:
    """Collect all work that is done within into one line, which is printed at the end."""
    summary = WorkSummary()
    _of_command.append(summary)
    try:
        yield
    finally:
        _of_command.remove(summary)
        summary.print()


def report_work(work: WorkDone, begin: float) -> None:
    """Print a line about work that began at this time of `time.perf_counter`, or keep it for the line of the command.

    Examples
    --------
    >>> with summarise_work():  # to standard error
    ...     report_work(WorkDone("steps", 40, 40), perf_counter())
    """
    if _of_command:
        _of_command[-1].add(work, begin)
        return
    summary = WorkSummary()
    summary.add(work, begin)
    summary.print()
