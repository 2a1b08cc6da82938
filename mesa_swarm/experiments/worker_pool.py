"""Processes that work at the same time, through joblib: on this machine, or on the cluster that joblib is set to."""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, suppress
from multiprocessing import resource_tracker
from time import sleep
from typing import Any

from joblib import Parallel, cpu_count, delayed
from joblib.parallel import LokyBackend, get_active_backend

from mesa_swarm.base.errors import InvalidValueError, check_count
from mesa_swarm.base.extras import require_extra
from mesa_swarm.experiments.worker_tasks import WorkerDiedError, worked
from mesa_swarm.model.gallery import list_imported

MOST_JOBS = 1024
LOCAL = "LokyBackend"
DASK = "DaskDistributedBackend"
# Interval at which workers check that their parent is there, s.
CHECK_EVERY = 0.5


def checked_jobs(jobs: int) -> int:
    """Return how many processes will work: as many as there are cores for -1."""
    if jobs == -1:
        return cpu_count()
    try:
        return check_count("jobs", jobs, minimum=1, maximum=MOST_JOBS)
    except InvalidValueError as error:
        raise InvalidValueError(f"{error}, or -1 for one on each core") from None


class Workers(LokyBackend):
    """Joblib's own processes, each of which ends when this one does, however that happens.

    Without this, workers of a process that was killed wait for work until joblib's time limit of five minutes: none
    of them sees the end of the pipe from which they read, since the others can write to it too.
    """

    def configure(self, n_jobs: int = 1, parallel: Parallel | None = None, **options: Any) -> int:
        """Start the processes and return how many there are."""
        watch = {"initializer": end_with, "initargs": (os.getpid(),)}
        return super().configure(n_jobs, parallel, **options, **watch)


def on_all(workers: int, work: Callable, tasks: Iterable[tuple]) -> Iterator[Any]:
    """Yield what `work` returns for each task, as they are done; quick ones are handed out in chunks.

    Inside `joblib.parallel_config` with another backend, such as dask, the work is done there. Tasks are read as
    workers become free, never far ahead. As soon as a worker is gone, WorkerDiedError is raised, and what was under way
    is lost; a cluster does that work elsewhere, see `dask_pool.on_cluster`.
    """
    backend = get_active_backend()[0]
    if type(backend).__name__ == DASK:
        from mesa_swarm.experiments.dask_pool import on_cluster  # noqa: PLC0415 - needs the extra [cluster]

        yield from on_cluster(backend.client, work, tasks)
        return
    place = {"n_jobs": -1} if is_remote() else {"n_jobs": workers, "backend": _local()}
    parallel = Parallel(**place, return_as="generator_unordered")
    results: Iterator[Any] = iter(())
    try:
        with _interrupts_held():
            modules = list_imported()  # before the work, whose models may be in them
            results = parallel(delayed(worked)(modules, work, task) for task in tasks)
        for result in results:  # noqa: UP028 - closed below, whatever ends this
            yield result
    except BrokenProcessPool as error:
        raise WorkerDiedError(str(error)) from error
    finally:
        _give_up(results)


def _give_up(results: Iterator[Any]) -> None:
    """Stop tasks whose results are no longer wanted, with the workers that do them; joblib would warn of them."""
    with warnings.catch_warnings(), _thread_of_loky_silenced():
        warnings.filterwarnings("ignore", r"[0-9]+ tasks (which|have)", UserWarning)
        if isinstance(results, Generator):
            results.close()


@contextmanager
def _thread_of_loky_silenced() -> Iterator[None]:
    """Ignore that loky's thread, when all tasks are given up, looks for those that it has not handed out yet."""
    before = threading.excepthook

    def hook(error: threading.ExceptHookArgs) -> None:
        is_lokys = error.thread is not None and error.thread.name == "ExecutorManagerThread"
        if not (is_lokys and issubclass(error.exc_type, KeyError)):
            before(error)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = before


def on_scheduler(address: str) -> AbstractContextManager[None]:
    """Return a context within which the workers of the dask scheduler at this address do the work."""
    require_extra("distributed", "cluster", "a scheduler needs", "dask.distributed")
    from mesa_swarm.experiments.dask_pool import connected  # noqa: PLC0415 - needs the extra [cluster]

    return connected(address)


def in_order(workers: int, work: Callable, tasks: list[tuple]) -> list[Any]:
    """Return what `work` returns for each task, in the order of the tasks: in this process if one is enough."""
    if workers == 1 and not is_remote():
        return [work(*task) for task in tasks]
    results = dict(on_all(workers, _numbered, ((k, work, task) for k, task in enumerate(tasks))))
    return [results[k] for k in range(len(tasks))]


def is_remote() -> bool:
    """Return whether joblib is set to another place for work than processes of this machine."""
    return type(get_active_backend()[0]).__name__ != LOCAL


def end_with(parent: int) -> None:
    """Let this process end at once when its parent, which has this id, is gone; also if it is gone already."""
    threading.Thread(target=_end_after, args=(parent,), name="end with the parent", daemon=True).start()


def ending_with_us(script: str) -> str:
    """Return Python code of a process that ends with this one, from before its imports on."""
    return f"from {__name__} import end_with; end_with({os.getpid()}); {script}"


def _end_after(parent: int) -> None:
    _wait_for_end(parent)
    os._exit(1)


if sys.platform == "win32":
    import _winapi

    def _wait_for_end(parent: int) -> None:
        with suppress(OSError):  # it is gone already
            process = _winapi.OpenProcess(_winapi.SYNCHRONIZE, False, parent)
            _winapi.WaitForSingleObject(process, _winapi.INFINITE)

else:

    def _wait_for_end(parent: int) -> None:
        while os.getppid() == parent:  # else another process has taken its children
            sleep(CHECK_EVERY)


def _local() -> Workers:
    """Return processes of this machine, with the number of threads that joblib is set to."""
    return Workers(inner_max_num_threads=get_active_backend()[0].inner_max_num_threads)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back while workers start: they inherit that it is blocked, since we stop them ourselves.

    Any thread of this process receives it, also one that does not block it: a handler notes it until all have started.
    """
    received: list[int] = []
    handler = signal.getsignal(signal.SIGINT)
    is_ours = threading.current_thread() is threading.main_thread() and handler is not None  # others may not change it
    if is_ours:
        signal.signal(signal.SIGINT, lambda number, frame: received.append(number))
    try:
        with _interrupts_blocked():
            yield
    finally:
        if is_ours:
            signal.signal(signal.SIGINT, handler)
        if received:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    mask = getattr(signal, "pthread_sigmask", None)
    if mask is None:  # on Windows
        yield
        return
    resource_tracker.ensure_running()  # else workers start it, which unblocks Ctrl-C
    before = mask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        mask(signal.SIG_SETMASK, before)


def _numbered(k: int, work: Callable, task: tuple) -> tuple[int, Any]:
    return k, work(*task)
