"""What work was done, as one line at the end, where a progress bar cannot be seen to move."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

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
        unit = self.unit.removesuffix("s") if self.total == 1 else self.unit
        earlier = f" ({self.before:,} done before)" if self.before else ""
        return f"{self.done:,} of {self.total:,} {unit}{earlier}"


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
        known = self.works.get(work.unit, WorkDone(work.unit, 0, 0))
        counts = known.done + work.done, known.total + work.total, known.before + work.before
        self.works[work.unit] = WorkDone(work.unit, *counts)

    def print(self) -> None:
        """Print one line to standard error, if there was any work."""
        if self.begin is not None and sys.stderr is not None:
            seconds = perf_counter() - self.begin
            print(f"{', '.join(map(str, self.works.values()))} in {in_words(seconds)}", file=sys.stderr, flush=True)


# The summary of the command that is run, if one is.
_of_command: list[WorkSummary] = []


@contextmanager
def one_line() -> Iterator[None]:
    """Collect all work that is done within into one line, which is printed at the end."""
    summary = WorkSummary()
    _of_command.append(summary)
    try:
        yield
    finally:
        _of_command.remove(summary)
        summary.print()


def report(work: WorkDone, begin: float) -> None:
    """Print a line about work that began at this time of `time.perf_counter`, or keep it for the line of the command.

    Examples
    --------
    >>> with one_line():  # to standard error
    ...     report(WorkDone("steps", 40, 40), perf_counter())
    """
    if _of_command:
        _of_command[-1].add(work, begin)
        return
    summary = WorkSummary()
    summary.add(work, begin)
    summary.print()


def in_words(seconds: float) -> str:
    """Return a time as text.

    Examples
    --------
    >>> in_words(0.34), in_words(125), in_words(7500)
    ('0.3 s', '2 min 5 s', '2 h 5 min')
    """
    if seconds < 59.95:  # 60.0 s is a minute
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60:,} h {minutes % 60} min"
