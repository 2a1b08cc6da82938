"""Processes that work at the same time, through joblib: on this machine, or on the cluster that joblib was told of."""

import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from threading import RLock
from typing import Any

from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor
from joblib.parallel import get_active_backend
from tqdm import tqdm

LOCAL = "LokyBackend"


class WorkerDiedError(RuntimeError):
    """A worker was killed, or crashed, with what it was working at."""


def on_all(workers: int, work: Callable, tasks: Iterable[tuple]) -> Iterator[Any]:
    """Yield what `work` returns for each task, as they are done; joblib hands out quick ones in chunks.

    Parameters
    ----------
    workers : int
        Processes on this machine. Inside `joblib.parallel_config` with another backend, such as dask, that one
        says where the work is done.
    work : callable
    tasks : iterable of tuple
        The arguments of each call; read as workers become free, never far ahead.

    Raises
    ------
    WorkerDiedError
        As soon as a worker is gone. What was under way is lost.

    Examples
    --------
    >>> sorted(on_all(2, pow, [(2, 3), (3, 2)]))
    [8, 9]
    """
    parallel = Parallel(n_jobs=-1 if is_remote() else workers, return_as="generator_unordered")
    try:
        with _interrupts_held():
            results = parallel(delayed(_worked)(work, task) for task in tasks)
        yield from results
    except BaseException as error:
        if not is_remote():
            # Without this, workers would finish what nobody waits for any more.
            get_reusable_executor().shutdown(wait=True, kill_workers=True)
        if isinstance(error, BrokenProcessPool) or type(error).__name__ == "KilledWorker":
            raise WorkerDiedError(str(error)) from error
        raise


def results_of(workers: int, work: Callable, tasks: Iterable[tuple]) -> Iterator[Any]:
    """Yield what `work` returns for each task, as they are done: by `on_all`, or in this process if one is enough.

    Examples
    --------
    >>> list(results_of(1, pow, [(2, 3), (3, 2)]))
    [8, 9]
    """
    if workers == 1:
        yield from (work(*task) for task in tasks)
        return
    yield from on_all(workers, work, tasks)


def is_remote() -> bool:
    """Whether joblib was told of another place for work than processes of this machine.

    Examples
    --------
    >>> is_remote()
    False
    """
    return type(get_active_backend()[0]).__name__ != LOCAL


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Let Ctrl-C wait while workers start: they inherit this and never hear it; we stop them ourselves."""
    hold = getattr(signal, "pthread_sigmask", None)
    if hold is None:  # on Windows
        yield
        return
    resource_tracker.ensure_running()  # else workers start it, which lets Ctrl-C through again
    before = hold(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        hold(signal.SIG_SETMASK, before)


def _worked(work: Callable, task: tuple) -> Any:
    # tqdm's own lock is one between processes, about which Python complains when a worker is stopped by Ctrl-C.
    tqdm.set_lock(RLock())
    return work(*task)
