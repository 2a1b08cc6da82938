"""Threads that share the rows of one step, or worlds that take their steps together.

A `RowCrew` waits in compiled code for ranges of rows that kernels share, see `kernels.crew`, while a model of many
robots takes steps, or many models do. There are as many threads as ranges, but no more than processors. They wait for
the next job in compiled code for a moment before they sleep, because waking takes longer than a small kernel. They
belong to the process and serve one model at a time; another that steps meanwhile does all of its work itself.
"""

import os
import signal
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from threading import Lock, Thread, current_thread, main_thread
from typing import Any
from weakref import WeakSet

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, shortened
from mesa_swarm.kernels.block import Block, KernelCall, code_address
from mesa_swarm.kernels.crew import (
    CODES,
    HELPING,
    JOB,
    MOST_THREADS,
    PARTS,
    REST,
    CrewArrays,
    SharedCall,
    begin_serving,
    end_serving,
    serve,
    share_kernel,
)
from mesa_swarm.kernels.waiting import count_processors, wait_while

VARIABLE = "MESA_SWARM_THREADS"
# Looks at a word before a thread sleeps: about a tenth of a millisecond.
LOOKS = np.int64(4000)


def check_threads(threads: int | None) -> int:
    """Return the number of threads of a model; without one that of the environment variable, or 1.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> check_threads(4)
    4
    """
    if threads is not None:
        return check_count("threads", threads, minimum=1, maximum=MOST_THREADS)
    text = os.environ.get(VARIABLE, "").strip() or "1"
    if not text.isdecimal() or not 1 <= int(text) <= MOST_THREADS:
        raise InvalidValueError(
            f"the environment variable {VARIABLE} is {shortened(text)}; expected a whole number, 1 to {MOST_THREADS}"
        )
    return int(text)


class RowThread:
    """A thread that does one job after another."""

    def __init__(self) -> None:
        # Numbers of the last job that was given and done, each in a cache line of its own.
        self._begun, self._done = np.zeros(8, np.int64), np.zeros(8, np.int64)
        self._wake: SimpleQueue = SimpleQueue()
        self._finished: SimpleQueue = SimpleQueue()
        self._asleep = self._awaited = False
        self._job: Callable[[], Any] | None = None
        self._error: BaseException | None = None
        self._last = 0
        Thread(target=self._serve, daemon=True, name="mesa_swarm rows").start()

    def start_job(self, job: Callable[[], Any]) -> None:
        """Give the thread a job."""
        self._job, self._error = job, None
        self._last += 1
        self._begun[0] = self._last
        if self._asleep:
            self._wake.put(None)

    def wait_for_job(self) -> BaseException | None:
        """Wait until the job is done, and return its error or None."""
        interrupted = None
        while self._done[0] != self._last:
            try:
                if wait_while(self._done, self._last - 1, LOOKS) != self._last:
                    self._awaited = True
                    if self._done[0] != self._last:
                        self._finished.get()
            except KeyboardInterrupt as interrupt:  # raised when the job is done: until then it writes
                interrupted = interrupt
        self._awaited = False
        return self._error or interrupted

    def _serve(self) -> None:
        jobs_done = 0
        while True:
            wait_while(self._begun, jobs_done, LOOKS)
            self._asleep = True
            # Each side writes its own word before it reads the other's, so one of them sees it and no wake-up is lost.
            while self._begun[0] == jobs_done:
                self._wake.get()
            self._asleep = False
            jobs_done += 1
            try:
                self._job()  # type: ignore[misc]
            except BaseException as error:  # raised where the job came from
                self._error = error
            self._done[0] = jobs_done
            if self._awaited:
                self._finished.put(None)


class RowThreads:
    """The threads of this process, made when they are first needed."""

    def __init__(self) -> None:
        self._lock, self._threads = Lock(), []  # type: tuple[Lock, list[RowThread]]

    def begin_serving(self, parts: int) -> list[RowThread]:
        """Let threads wait for ranges of rows, see `share_rows`, and return them; none if another model has them."""
        helping = min(parts, count_processors()) - 1
        if helping < 1 or not self._lock.acquire(blocking=False):
            return []
        try:
            threads = self._helpers(helping)
        except BaseException:
            self._lock.release()
            raise
        begin_serving()
        for thread in threads:
            thread.start_job(partial(serve, JOB, CODES, REST))
        return threads

    def end_serving(self, threads: list[RowThread]) -> None:
        """Let these threads end, and others have them."""
        if not threads:
            return
        try:
            end_serving()
            errors = [error for error in [thread.wait_for_job() for thread in threads] if error is not None]
        finally:
            self._lock.release()
        if errors:
            raise errors[0]

    def _helpers(self, helping: int) -> list[RowThread]:
        if not self._threads:
            end_serving()
            serve(JOB, CODES, REST)  # compiled here: an error is raised where the threads are required
        while len(self._threads) < helping:
            self._threads.append(RowThread())
        return self._threads[:helping]


ROW_THREADS = RowThreads()


class Interrupts:
    """What Ctrl-C would raise in the main thread is raised afterwards: threads are begun and ended as a whole."""

    def __init__(self) -> None:
        self._handler: Any = None
        self._noted: tuple[Any, ...] | None = None

    def hold(self) -> None:
        """Note interrupts from now on, unless they are ignored, or raised in another thread."""
        handler = signal.getsignal(signal.SIGINT)
        if current_thread() is main_thread() and callable(handler) and self._handler is None:
            self._handler = handler
            signal.signal(signal.SIGINT, self._note)

    def _note(self, *arguments: Any) -> None:
        self._noted = arguments

    def let_go(self) -> None:
        """Raise those that were noted, and those to come."""
        handler, self._handler = self._handler, None
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        noted, self._noted = self._noted, None
        if noted is not None:
            handler(*noted)

    def forget(self) -> None:
        """Raise those to come, and none that was noted."""
        self._noted = None
        self.let_go()


CREWS: WeakSet["RowCrew"] = WeakSet()


def _forget_threads() -> None:
    """Begin anew in a process that was forked: threads are not copied."""
    ROW_THREADS.__init__()  # type: ignore[misc]
    begin_serving()
    for crew in CREWS:
        crew.forget_work()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_threads)


class RowCrew:
    """The threads that share the rows of a model in compiled code.

    Attributes
    ----------
    numbers : int64 ndarray
        Of a block of `CrewArrays`, as `share_rows` takes it.
    """

    def __init__(self) -> None:
        self._size = np.array([1, 0], np.int64)
        self._helpers: list[RowThread] = []
        self._depth = 0  # a stage within a step of this model may let threads help as well
        self._interrupts = Interrupts()
        CREWS.add(self)
        self._block = Block(CrewArrays(self._size, JOB, CODES, REST))
        self.numbers = self._block.numbers

    @property
    def parts(self) -> int:
        """Into how many ranges rows are cut."""
        return int(self._size[PARTS])

    @parts.setter
    def parts(self, parts: int) -> None:
        self._size[PARTS] = parts

    def call_of(self, kernel: Any, block: np.ndarray) -> tuple[KernelCall, Block | None]:
        """Return the call of a kernel for all rows, shared if there is more than one range, and what it refers to."""
        if self.parts == 1:
            return KernelCall(code_address(kernel), block), None
        shared = Block(SharedCall(self.numbers, code_address(kernel), block))
        return KernelCall(code_address(share_kernel), shared.numbers), shared

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how a copy is made: a crew of its own."""
        return RowCrew, ()

    def __enter__(self) -> None:
        """Let threads help, those that no other model has, until `__exit__`; Ctrl-C is raised then."""
        self._depth += 1
        if self._depth > 1:
            return
        self._interrupts.hold()
        try:
            self._helpers = ROW_THREADS.begin_serving(self.parts)
            self._size[HELPING] = len(self._helpers)
        except BaseException:
            self._depth = 0
            self._interrupts.let_go()
            raise

    def __exit__(self, *_: object) -> None:
        """Let no thread help any longer."""
        self._depth -= 1
        if self._depth > 0:
            return
        threads = self._helpers
        self._size[HELPING], self._helpers, self._depth = 0, [], 0
        try:
            ROW_THREADS.end_serving(threads)
        finally:
            self._interrupts.let_go()

    def forget_work(self) -> None:
        """Be as before `__enter__`, without threads that could be ended."""
        self._size[HELPING], self._helpers, self._depth = 0, [], 0
        self._interrupts.forget()
