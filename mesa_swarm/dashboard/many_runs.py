"""A comparison over many seeds in a process of its own, so that the page stays quick, and can be stopped at once."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from typing import IO, Any, cast

from joblib import cpu_count

from mesa_swarm.dashboard.listeners import Listeners
from mesa_swarm.dashboard.readings import in_words
from mesa_swarm.errors import SwarmError
from mesa_swarm.experiments.compare import Comparison, run_plan
from mesa_swarm.experiments.comparison_figures import comparison_figure, main_measure
from mesa_swarm.experiments.pictures import png
from mesa_swarm.experiments.plan import Plan
from mesa_swarm.experiments.pool import ending_with_us
from mesa_swarm.experiments.tables import runs_csv, table_and_notes

# So many comparisons are under way at the same time, of all who use this server.
MOST_AT_ONCE = 2
# News of progress are told so often at most, s.
TELL_EVERY = 0.2
# The processes give way to the page's.
NICENESS = 10
# Of the picture, inches: smaller than for a projector, so that its letters are not.
SIZE = (8.6, 6.8)
_under_way = threading.BoundedSemaphore(MOST_AT_ONCE)


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """What came of a comparison, ready to be shown.

    Parameters
    ----------
    title, finding : str
    table : list of list of str
        The first line is the header.
    notes : list of str
    picture : bytes
        A PNG.
    runs : str
        Every run, as CSV.
    """

    title: str
    finding: str
    table: list[list[str]]
    notes: list[str]
    picture: bytes
    runs: str


def report_of(comparison: Comparison) -> Report:
    """Return what there is to show of a comparison.

    Examples
    --------
    >>> from mesa_swarm.experiments.compare import compare
    >>> report_of(compare("fire_fighting", seeds=2, steps=5, jobs=1)).table[0][:2]
    ['', 'strategy']
    """
    plan = comparison.plan
    table, notes = table_and_notes(comparison)
    figure = comparison_figure(comparison, [main_measure(comparison)])
    figure.set_size_inches(*SIZE)
    return Report(
        title=f"{plan.model_class.__name__}, {plan.parameter}: {len(plan.seeds)} paired seeds, {plan.steps:,} steps",
        finding=comparison.finding(),
        table=table,
        notes=notes,
        picture=png(figure),
        runs=runs_csv(comparison),
    )


class ManyRuns:
    """Does the runs of a plan in the background, one plan at a time.

    Attributes
    ----------
    changed : Listeners
        Told of progress, and of the end; from another thread.
    done, total : int
        Runs.
    report : Report or None
        What came of the last plan.
    error : str
        Why nothing came of it, empty if something did.

    Examples
    --------
    >>> runs = ManyRuns()
    >>> runs.running, runs.left
    (False, '')
    """

    def __init__(self) -> None:
        self.changed = Listeners()
        self.done = self.total = 0
        self.report: Report | None = None
        self.error = ""
        self._process: subprocess.Popen | None = None
        self._began = self._told = 0.0
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether a plan is under way."""
        return self._process is not None

    @property
    def left(self) -> str:
        """The time left, empty while that cannot be told."""
        if not self.running or not self.done:
            return ""
        seconds = (time.monotonic() - self._began) / self.done * (self.total - self.done)
        return f"about {timedelta(seconds=round(seconds))} left"

    def start(self, plan: Plan) -> None:
        """Begin with a plan.

        Raises
        ------
        SwarmError
            If one is under way, or too many are on this server.
        """
        with self._lock:
            if self.running:
                raise SwarmError("a comparison is under way; cancel it first")
            if not _under_way.acquire(blocking=False):
                raise SwarmError(f"{MOST_AT_ONCE} comparisons are under way on this server; try again when one is done")
            self.done, self.total, self.report, self.error = 0, len(plan.tasks), None, ""
            self._began = time.monotonic()
            try:
                self._process = _begun(plan)
            except OSError as error:
                _under_way.release()
                raise SwarmError(f"no process could be started ({error.strerror})") from error
            threading.Thread(target=self._follow, args=(self._process,), name="many runs", daemon=True).start()
        self.changed.tell()

    def cancel(self) -> None:
        """Stop what is under way, at once; nothing comes of it."""
        with self._lock:
            process, self._process = self._process, None
            if process is not None:
                _end(process)
        if process is not None:
            self.error = f"cancelled after {self.done} of {self.total} runs"
            self.changed.tell()

    def close(self) -> None:
        """Stop what is under way, and forget everybody who listens."""
        self.changed.clear()
        self.cancel()
        self.report = None

    def _follow(self, process: subprocess.Popen) -> None:
        """Hear what the process says until it ends, and clean up after it."""
        try:
            for kind, value in _heard(process):
                if self._process is process:
                    self._take(kind, value)
        finally:
            _end(process)
            for pipe in _pipes(process):
                with suppress(OSError):
                    pipe.close()
            _under_way.release()
        with self._lock:
            ended_by_itself = self._process is process
            if ended_by_itself:
                self._process = None
        if ended_by_itself:
            self.error = self.error or ("" if self.report else "the runs ended without a result; try again")
            self.changed.tell()

    def _take(self, kind: str, value: Any) -> None:
        if kind == "run":
            self.done += 1
            if time.monotonic() - self._told > TELL_EVERY:
                self._told = time.monotonic()
                self.changed.tell()
        elif kind == "report":
            self.report = value
        else:
            self.error = value


def workers_for(plan: Plan) -> int:
    """Return how many processes work at a plan: one less than there are cores, which is left to the page."""
    return max(1, min(cpu_count() - 1, len(plan.tasks)))


def _begun(plan: Plan) -> subprocess.Popen:
    """Start the process, in a group of its own, and hand it the plan."""
    process = subprocess.Popen(
        [sys.executable, "-c", ending_with_us(f"from {__name__} import main; main()")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    with suppress(BrokenPipeError):  # it has died already, which is heard soon
        to_it, _ = _pipes(process)
        pickle.dump((plan, workers_for(plan)), to_it)
        to_it.flush()
    return process


def _pipes(process: subprocess.Popen) -> tuple[IO[bytes], IO[bytes]]:
    """Return the pipes to and from the process, which `_begun` has made."""
    return cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)


def _heard(process: subprocess.Popen) -> Iterator[tuple[str, Any]]:
    """Yield what the process says."""
    _, from_it = _pipes(process)
    while True:
        try:
            yield pickle.load(from_it)
        except Exception:  # its end, or half of what it said when it was killed
            return


def _end(process: subprocess.Popen) -> None:
    """End the process and all that it has started."""
    with suppress(ProcessLookupError, PermissionError):  # it has ended by itself
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:  # on Windows
            process.kill()
    process.wait()


def main() -> None:
    """Do the runs of the plan that comes in, and say what comes of each."""
    plan, workers = pickle.load(sys.stdin.buffer)
    said = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what models print is none of it
    if hasattr(os, "nice"):
        os.nice(NICENESS)

    def say(kind: str, value: object) -> None:
        pickle.dump((kind, value), said)
        said.flush()

    _do(plan, workers, say)


def _do(plan: Plan, workers: int, say: Callable[[str, object], None]) -> None:
    try:
        say("report", report_of(run_plan(plan, workers, heard=lambda run: say("run", run.rng))))
    except Exception as problem:  # whatever a model raises
        say("error", in_words(problem))
