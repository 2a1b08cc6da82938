"""Tasks on the workers of a dask cluster: quick ones in chunks, and one line about workers and schedulers that go."""

import logging
import re
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from queue import Empty, SimpleQueue
from time import monotonic, perf_counter
from typing import Any

from distributed import CancelledError, Client, Future, KilledWorker
from distributed.client import ClosedClientError
from distributed.protocol.pickle import dumps, loads
from distributed.security import Security
from joblib import parallel_config

from mesa_swarm.base.errors import InvalidValueError, error_line, shortened
from mesa_swarm.base.progress import notice
from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.worker_tasks import SchedulerLostError, WorkerDiedError, worked
from mesa_swarm.model.gallery import list_imported

ADDRESS = re.compile(r"((tcp|tls)://)?[^\s/]+:[0-9]{1,5}")
# A chunk takes about so long, s, and ends with the run that takes it beyond twice this: what is lost with a worker, and
# far more than what handing it out takes.
CHUNK_SECONDS = 0.2
LARGEST_CHUNK = 256
# Chunks under way beyond two for each thread: without them a cluster that grows with its work would never grow.
AHEAD = 8
# Interval at which the workers are counted, and at which their absence is reported again, s.
COUNT_EVERY = 2.0
REPORT_EVERY = 600.0
# Longest time for which a scheduler may be silent when it is asked something, s.
PATIENCE = 10.0


@contextmanager
def connected(address: str) -> Iterator[None]:
    """Let the workers of this scheduler do what is done within.

    Raises
    ------
    InvalidValueError
        If no scheduler answers there.
    """
    if ADDRESS.fullmatch(address) is None:
        raise _no_scheduler(address, "not an address")
    if address.startswith("tls:") and Security().get_connection_args("client").get("ssl_context") is None:
        raise _no_scheduler(address, "dask has no certificates: see distributed.comm.tls in its documentation")
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise _no_scheduler(address, " ".join(str(error).split())) from None
    log = logging.getLogger("distributed.client")
    level = log.level
    log.setLevel(logging.CRITICAL)  # a lost scheduler is reported in one line, not in tracebacks
    try:
        with parallel_config(backend="dask", client=client):
            yield
    finally:
        client.close(timeout=COUNT_EVERY)
        log.setLevel(level)


def _no_scheduler(address: str, reason: str) -> InvalidValueError:
    return InvalidValueError(
        f"no dask scheduler answers at {shortened(address)} ({reason[:100]}); expected an address such as "
        "tcp://HOST:8786, which `dask scheduler` prints when it is started"
    )


def on_cluster(client: Client, work: Callable, tasks: Iterable[tuple]) -> Iterator[Any]:
    """Yield what `work` returns for each task, as they are done on the workers of a dask cluster.

    Tasks whose workers die, four of them, are set aside until all others are done; then WorkerDiedError is raised.

    Raises
    ------
    SchedulerLostError
        As soon as the connection to the scheduler is lost.
    """
    chunks = Chunks(client, work)
    try:
        yield from chunks.results(iter(tasks))
    finally:
        chunks.release()


class Chunks:
    """Tasks under way on a cluster, in chunks of as many as take a fifth of a second."""

    def __init__(self, client: Client, work: Callable) -> None:
        self._client = client
        self._work = work
        self._crew = Crew(client)
        self._size = 1
        self._under_way: dict[Any, tuple[Future, list[tuple]]] = {}
        self._ended: SimpleQueue[Future] = SimpleQueue()
        self._set_aside = 0
        self._left: deque[tuple] = deque()  # the tasks of chunks that took too long

    def results(self, tasks: Iterator[tuple]) -> Iterator[Any]:
        """Yield results as they arrive."""
        while True:
            if self._client.status in ("closing", "closed"):
                raise self._lost()
            try:
                self._hand_out(tasks)
            except ClosedClientError:
                raise self._lost() from None
            if not self._under_way:
                break
            self._crew.count()
            try:
                ended = self._ended.get(timeout=COUNT_EVERY)
            except Empty:
                continue
            yield from self._results_of(ended)
        if self._set_aside:
            raise WorkerDiedError(f"the workers of {quantity(self._set_aside, 'task')} died")

    def release(self) -> None:
        """Give up what is still under way."""
        for future, _ in self._under_way.values():
            future.release()
        self._under_way.clear()

    def _hand_out(self, tasks: Iterator[tuple]) -> None:
        while len(self._under_way) < 2 * self._crew.threads + AHEAD:
            left = min(self._size, len(self._left))
            chunk = [self._left.popleft() for _ in range(left)] or list(islice(tasks, self._size))
            if not chunk:
                return
            self._submit(chunk)

    def _submit(self, chunk: list[tuple]) -> None:
        # In one piece: dask would look for its own tasks in tuples. What was imported comes before what needs it.
        content = dumps((list_imported(), self._work, chunk))
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph")  # maps of many shapes
            future = self._client.submit(_results_and_seconds, content, pure=False)
        self._under_way[future.key] = future, chunk
        future.add_done_callback(self._ended.put)

    def _results_of(self, future: Future) -> list[Any]:
        """Return the results of a chunk that has ended, none if it is to be done again."""
        _, chunk = self._under_way[future.key]
        try:
            results, seconds = future.result(timeout=PATIENCE)
        except KilledWorker:
            results = self._again(chunk)
        except (TimeoutError, CancelledError):
            if future.status == "error":  # that of the task itself
                raise
            if future.cancelled():
                raise self._lost() from None
            # Its worker died before the results were here: dask does it again.
            future.add_done_callback(self._ended.put)
            return []
        except OSError:  # of the connection, unless it is that of the task itself
            if future.status == "error":
                raise
            raise self._lost() from None
        except (ImportError, RuntimeError) as error:
            missing = error if isinstance(error, ImportError) else error.__cause__  # the scheduler wraps its own
            if not isinstance(missing, ImportError):
                raise
            raise InvalidValueError(
                f"the scheduler or a worker cannot import what it needs: {error_line(missing)[:150]}; install the same "
                "packages on all machines, that of the scheduler too"
            ) from None
        else:
            self._adapt(len(results), seconds)
            self._left.extend(chunk[len(results) :])
        del self._under_way[future.key]
        return results

    def _again(self, chunk: list[tuple]) -> list[Any]:
        """Hand out the tasks of a chunk whose workers died one by one, and set aside one that was alone."""
        if len(chunk) == 1:
            self._set_aside += 1
        else:
            for task in chunk:
                self._submit([task])
        return []

    def _adapt(self, tasks: int, seconds: float) -> None:
        """Change the size of chunks, at most to twice as many: the first tasks may be quicker than others."""
        fitting = int(CHUNK_SECONDS * tasks / max(seconds, 1e-6))
        self._size = max(1, min(fitting, 2 * self._size, LARGEST_CHUNK))

    def _lost(self) -> SchedulerLostError:
        return SchedulerLostError(
            f"the connection to the dask scheduler at {address_of_scheduler(self._client)} is lost"
        )


class Crew:
    """The workers of a cluster: how many threads they have, and lines on standard error while there are none."""

    def __init__(self, client: Client) -> None:
        self.threads = 0
        self._client = client
        self._next_count = 0.0
        self._next_report: float | None = None

    def count(self) -> None:
        """Count the threads, unless that was done a moment ago."""
        now = monotonic()
        if now < self._next_count:
            return
        self._next_count = now + COUNT_EVERY
        scheduler = self._client.scheduler
        if scheduler is None:  # the client was closed, which the next round reports
            return
        with suppress(OSError):  # a scheduler that is gone is noticed by what was under way
            threads = self._client.sync(scheduler.ncores, callback_timeout=PATIENCE)
            self.threads = sum(threads.values())
            self._report(len(threads), now)

    def _report(self, workers: int, now: float) -> None:
        if workers and self._next_report is not None:
            notice(f"{quantity(workers, 'worker')} connected to the scheduler; the work continues")
            self._next_report = None
        elif not workers and now >= (self._next_report or 0.0):
            address = address_of_scheduler(self._client)
            notice(
                f"no worker is connected to the scheduler at {address}; waiting; start one with: "
                f"dask worker {address} --nthreads 1"
            )
            self._next_report = now + REPORT_EVERY


def address_of_scheduler(client: Client) -> str:
    """Return the address of the scheduler to which a client is, or was, connected."""
    return str(client.scheduler.address) if client.scheduler is not None else "an unknown address"


def _results_and_seconds(content: bytes) -> tuple[list[Any], float]:
    """Do a chunk of tasks on a worker, or as many of them as its time allows: others may be quicker or free."""
    modules, work, chunk = loads(content)
    begin, results = perf_counter(), []
    for task in chunk:
        results.append(worked(modules, work, task))
        if perf_counter() - begin > 2 * CHUNK_SECONDS:
            break
    return results, perf_counter() - begin
