"""What a worker does with a task, here or elsewhere, and the errors of workers and schedulers that are lost."""

from collections.abc import Callable
from threading import RLock
from typing import Any

from tqdm import tqdm

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.model.gallery import Imported


class WorkerDiedError(RuntimeError):
    """A worker was killed, or crashed, and its task is lost."""


class SchedulerLostError(SwarmError, RuntimeError):
    """The connection to the scheduler of a cluster is lost, and with it the tasks that were under way."""


def worked(_modules: Imported, work: Callable, task: tuple) -> Any:
    """Return the result of a task, in a worker that can import these modules."""
    # tqdm's own lock is one between processes, about which Python complains when a worker is stopped by Ctrl-C.
    tqdm.set_lock(RLock())
    return work(*task)
