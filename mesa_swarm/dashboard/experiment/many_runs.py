"""Many runs in the background: in processes of their own, which end on request or with the page."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import timedelta
from typing import IO, Any, Protocol, cast

from joblib import cpu_count

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments.worker_pool import ending_with_us
from mesa_swarm.model.gallery import list_imported
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.play_loop import Listeners

# Largest number of comparisons and experiments at the same time, of all users of this server.
MOST_AT_ONCE = 2
# Shortest time between notifications of progress, s.
NOTIFY_EVERY = 0.2
# The processes have a lower priority than the page.
NICENESS = 10
_under_way = threading.BoundedSemaphore(MOST_AT_ONCE)

# Sends a message to the page: "before" with a list of earlier runs, "run" with a finished one, "report", "error".
Send = Callable[[str, object], None]


class BackgroundTask(Protocol):
    """Runs to be done in the background; it is sent to a process there by pickle."""

    def __len__(self) -> int:
        """Count the runs."""

    def do(self, workers: int, send: Send) -> None:
        """Do them on this number of processes; send a message for each, and a report at the end."""


class ManyRuns:
    """Does many runs in the background, one `BackgroundTask` at a time; notifies from another thread.

    Parameters
    ----------
    name : str
        Of such a task, in messages.
    """

    def __init__(self, name: str = "comparison") -> None:
        self.changed = Listeners()
        # Runs that are done, those of them that were done earlier, and all.
        self.done = self.before = self.total = 0
        self.report: Any = None
        self.error = ""
        self._name = name
        self._process: subprocess.Popen | None = None
        self._began = self._last = self._notified = 0.0
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether a task is under way."""
        return self._process is not None

    @property
    def left(self) -> str:
        """The time left, empty before the first run is done."""
        if not self.running or self.done == self.before:
            return ""
        return f"about {timedelta(seconds=round(self.pace * (self.total - self.done)))} left"

    @property
    def pace(self) -> float:
        """Seconds a run so far, 0 before the first one is done."""
        fresh = self.done - self.before
        return (self._last - self._began) / fresh if fresh else 0.0

    def start(self, task: BackgroundTask, report: Callable[[Any], object] = lambda run: None) -> None:
        """Begin with a task, unless one is under way or too many are on this server.

        `report` is called, in another thread, with what the task sends of each run.
        """
        with self._lock:
            if self.running:
                raise SwarmError(
                    f"{'an' if self._name[0] in 'aeiou' else 'a'} {self._name} is under way; cancel it first"
                )
            if not _under_way.acquire(blocking=False):
                what = f"{MOST_AT_ONCE} comparisons or experiments are under way on this server"
                raise SwarmError(f"{what}; try again when one is done")
            self.done, self.before, self.total, self.report, self.error = 0, 0, len(task), None, ""
            self._began = self._last = time.monotonic()
            try:
                self._process = _begin_process(task)
            except Exception as error:
                _under_way.release()
                if not isinstance(error, OSError):  # a task with a user's objects may not be picklable
                    raise
                raise SwarmError(f"no process could be started ({error.strerror})") from error
            about = (self._process, report)
            threading.Thread(target=self._follow, args=about, name="many runs", daemon=True).start()
        self.changed.notify()

    def cancel(self) -> None:
        """Stop what is under way, at once and without a report, and note that as an error."""
        if self.stop():
            self.error = f"cancelled after {self.done} of {self.total} runs"
            self.changed.notify()

    def stop(self) -> bool:
        """Stop what is under way, at once and without a report; return whether there was anything."""
        with self._lock:
            process, self._process = self._process, None
            if process is not None:
                _end(process)
        return process is not None

    def close(self) -> None:
        """Stop what is under way, and remove all listeners."""
        self.changed.clear()
        self.cancel()
        self.report = None

    def _follow(self, process: subprocess.Popen, report: Callable[[Any], object]) -> None:
        """Receive the messages of the process until it ends, and clean up after it."""
        try:
            for kind, value in _receive_messages(process):
                if self._process is process:
                    self._take(kind, value, report)
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
            self.changed.notify()

    def _take(self, kind: str, value: Any, report: Callable[[Any], object]) -> None:
        if kind in ("before", "run"):
            runs, now = value if kind == "before" else [value], time.monotonic()
            for run in runs:
                report(run)
            self.done, self._last = self.done + len(runs), now
            if kind == "before":
                self.before, self._began = len(runs), now
            if now - self._notified > NOTIFY_EVERY:
                self._notified = now
                self.changed.notify()
        elif kind == "report":
            self.report = value
        else:
            self.error = value


def workers_for(task: BackgroundTask) -> int:
    """Return the number of processes for a task: one less than the number of cores, which is left to the page."""
    return max(1, min(cpu_count() - 1, len(task)))


def _begin_process(task: BackgroundTask) -> subprocess.Popen:
    """Start the process, in its own group, and send it the task."""
    message = pickle.dumps((list_imported(), task, workers_for(task)))  # what is imported comes first
    process = subprocess.Popen(
        [sys.executable, "-c", ending_with_us(f"from {__name__} import main; main()")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    with suppress(BrokenPipeError):  # it has ended already, which is noticed soon
        to_it, _ = _pipes(process)
        to_it.write(message)
        to_it.flush()
    return process


def _pipes(process: subprocess.Popen) -> tuple[IO[bytes], IO[bytes]]:
    """Return the pipes to and from the process, which `_begin_process` has made."""
    return cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)


def _receive_messages(process: subprocess.Popen) -> Iterator[tuple[str, Any]]:
    """Yield the messages of the process."""
    _, from_it = _pipes(process)
    while True:
        try:
            yield pickle.load(from_it)
        except Exception:  # its end, or half of a message when it was killed
            return


def _end(process: subprocess.Popen) -> None:
    """End the process and all that it has started, unless this was done: its number may be another's by now."""
    if process.returncode is not None:
        return
    with suppress(ProcessLookupError, PermissionError):  # it has ended by itself
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:  # on Windows
            process.kill()
    process.wait()


def main() -> None:
    """Do the task that stdin has, and send the results."""
    _, task, workers = pickle.load(sys.stdin.buffer)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what models print goes elsewhere
    if hasattr(os, "nice"):
        os.nice(NICENESS)

    def send(kind: str, value: object) -> None:
        pickle.dump((kind, value), out)
        out.flush()

    do_task(task, workers, send)


def do_task(task: BackgroundTask, workers: int, send: Send) -> None:
    """Do a task, and send the error that ends it."""
    try:
        task.do(workers, send)
    except Exception as problem:  # a model may raise anything
        send("error", reported(problem))
