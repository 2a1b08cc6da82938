"""How a number is measured, on this machine, and compared with its limit."""

import math
import os
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from mesa_swarm.experiments import csv_text


@dataclass(frozen=True, kw_only=True, slots=True)
class Goal:
    """A number that is measured, and its limit: the most, or the least that passes; None without one.

    Examples
    --------
    >>> print(Goal(what="two threads", unit="times as fast as one", limit=1.75, least=True).verdict(1.8))
    two threads, times as fast as one: 1.8 (required: at least 1.75, passed)
    """

    what: str
    unit: str
    limit: float | None = None
    least: bool = False

    def passed(self, value: float) -> bool:
        """Return whether a value passes; without a limit each does."""
        if self.limit is None:
            return True
        return value >= self.limit if self.least else value <= self.limit

    def verdict(self, value: float) -> str:
        """Return one line: what was measured, and if there is a limit, what is required and whether it is passed."""
        line = f"{self.what}, {self.unit}: {rounded_text(value)}"
        if self.limit is None:
            return line
        bound = "at least" if self.least else "at most"
        outcome = "passed" if self.passed(value) else "MISSED"
        return f"{line} (required: {bound} {self.limit:,}, {outcome})"


@dataclass(frozen=True, kw_only=True, slots=True)
class Measurement:
    """Numbers that are measured together: `measure` is given `Effort` and returns one for each goal, NaN for unknown.

    A quick report leaves out those that are not `quick`.
    """

    goals: tuple[Goal, ...]
    measure: Callable[["Effort"], Sequence[float]]
    quick: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class Effort:
    """How often a measurement is repeated, and the seconds that all repetitions take together, about."""

    repetitions: int
    budget: float


QUICK = Effort(repetitions=3, budget=0.1)
FULL = Effort(repetitions=9, budget=3.0)


def rounded_text(value: float | None) -> str:
    """Return a number with three digits, or more before its point; no text for None.

    Examples
    --------
    >>> rounded_text(0.12345), rounded_text(12345.6)
    ('0.123', '12,346')
    """
    if value is None:
        return ""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


class NotMeasuredError(Exception):
    """Why something cannot be measured on this machine, in one line."""


def measured(measurement: Measurement, effort: Effort) -> Generator[str, None, Sequence[float]]:
    """Yield a line for each goal, or why it is not measured, and return the numbers, NaN where there are none."""
    goals = measurement.goals
    try:
        values, reason = measurement.measure(effort), "this system does not show it"
    except NotMeasuredError as error:
        values, reason = [math.nan] * len(goals), str(error)
    for goal, value in zip(goals, values, strict=True):
        yield f"{goal.what}, {goal.unit}: not measured, {reason}" if math.isnan(value) else goal.verdict(value)
    return values


def goals_csv(rows: Sequence[tuple[Goal, float]]) -> str:
    """Return one line per goal: measured, limit and whether it is passed, empty where it was not measured."""
    header = ["what", "unit", "measured", "required", "bound", "passed"]
    return csv_text([header, *(_goal_cells(goal, value) for goal, value in rows)])


def _goal_cells(goal: Goal, value: float) -> list[Any]:
    shown = None if math.isnan(value) else value
    passed = None if shown is None or goal.limit is None else "yes" if goal.passed(value) else "no"
    bound = None if goal.limit is None else "least" if goal.least else "most"
    return [goal.what, goal.unit, shown, goal.limit, bound, passed]


def step_seconds(
    step: Callable[[], object], repetitions: int, budget: float, clock: Callable[[], float] = perf_counter
) -> float:
    """Return the seconds of one step: the median over repetitions, each of as many steps as its budget allows.

    `budget` is in seconds, about, for all of them together.
    """
    for _ in range(5):
        step()
    count = max(int(budget / repetitions / max(mean_seconds(step, 1, clock), 1e-7)), 1)
    return float(np.median([mean_seconds(step, count, clock) for _ in range(repetitions)]))


def mean_seconds(step: Callable[[], object], count: int, clock: Callable[[], float] = perf_counter) -> float:
    """Return the mean seconds of a step over this number of steps."""
    started = clock()
    for _ in range(count):
        step()
    return (clock() - started) / count


def printed_numbers(program: str, *words: str, environment: dict[str, str] | None = None) -> list[float]:
    """Return the numbers that a program prints in a process of its own, with one thread unless it sets more."""
    inherited = {name: value for name, value in os.environ.items() if name != "MESA_SWARM_THREADS"}
    with TemporaryDirectory() as folder:
        file = Path(folder, "measured.py")  # rules are compiled from their source
        file.write_text(program, encoding="utf-8")
        printed = output_of([sys.executable, str(file), *words], "the process", {**inherited, **(environment or {})})
    return [float(word) for word in printed.split()]


def output_of(command: Sequence[str], what: str, environment: dict[str, str] | None = None) -> str:
    """Return what a command prints; `what` it is for messages.

    Raises
    ------
    NotMeasuredError
        If it does not start or does not succeed, with its status or signal and one line of what it reports.
    """
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    except OSError as error:
        raise NotMeasuredError(f"{what} does not start: {error.strerror}") from None
    if done.returncode:
        raise NotMeasuredError(f"{what} {_end_in_words(done.returncode)}: {_line_of_error(done.stderr)}")
    return done.stdout


def _end_in_words(status: int) -> str:
    return f"ended with status {status}" if status > 0 else f"was ended by signal {-status}"


def _line_of_error(text: str) -> str:
    """Return the line of a report that names the error: a compiler's first one, or else the last."""
    lines = text.strip().splitlines() or ["no message"]
    return next((line for line in lines if "error: " in line), lines[-1])


def repeated(program: str, times: int) -> Sequence[float]:
    """Return medians of the numbers that a program prints, after a first time that fills the caches."""
    printed_numbers(program)
    return list(np.median([printed_numbers(program) for _ in range(times)], axis=0))
