"""Sweeps: many runs on many processes that a kill only interrupts, never spoils."""

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from mesa_swarm.experiments.compare import checked_jobs
from mesa_swarm.experiments.experiment import Experiment, Outcome, Task, carried_out, checked_experiment
from mesa_swarm.experiments.files import check_writable
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.pool import WorkerDiedError, is_remote, on_all
from mesa_swarm.experiments.sampling import Sample
from mesa_swarm.experiments.sweep_table import write_table
from mesa_swarm.gallery import find_model
from mesa_swarm.progress import progress_bar

LEDGER = "ledger.jsonl"
TABLE = "runs.parquet"
# A run under way when its worker died is tried again beside others, and from then on alone, to see who is to blame.
TRIES = 3


@dataclass(frozen=True, slots=True)
class Sweep:
    """What came of a sweep.

    Parameters
    ----------
    path : Path
        The table, as Parquet, one row a run.
    runs, failed, done_before : int
        All runs; those that ended in an error; those that an earlier call had done.
    """

    path: Path
    runs: int
    failed: int
    done_before: int

    def frame(self) -> pd.DataFrame:
        """Return the table."""
        return pd.read_parquet(self.path)


def sweep(
    model: type | str,
    varied: Mapping[str, Sequence] | Sample | Sequence[Mapping] = (),
    *,
    seeds: int | Sequence[int] = 30,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measure: Sequence[str] = (),
    out: str | os.PathLike[str] = "results",
    jobs: int = -1,
    progress: bool = False,
    retry_failed: bool = False,
) -> Sweep:
    """Run a model at every point of a grid or sample with every seed, and write a table of what came of it.

    Each finished run is on the disk before the next is waited for. A sweep that was interrupted, or whose process
    or workers were killed, goes on where it was when it is called again with the same folder; runs that another
    sweep has done there are not done again. A run that ends in an error is recorded with it. A run whose worker
    dies is tried again, three times in all. Runs of code that was changed since are other runs (`source_hash`).

    Parameters
    ----------
    model, varied, seeds, steps, settings, measure
        See `checked_experiment`; the model may be the name of one of the gallery.
    out : path
        Folder of the ledger and the table.
    jobs : int
        Processes on this machine; -1 for one on each core, 1 for this one. Inside
        `joblib.parallel_config(backend="dask")` the workers of the cluster do the work.
    progress : bool
        Whether to show a bar with the time left, in a terminal or notebook.
    retry_failed : bool
        Whether to do again what ended in an error before.

    Raises
    ------
    SwarmError
        Before anything is run, if anything about it is wrong.

    Notes
    -----
    On a cluster (``pip install 'mesa-swarm[cluster]'`` on all its machines, the same versions everywhere)::

        dask scheduler                                              # on one machine
        dask worker tcp://SCHEDULER:8786 --nthreads 1 --nworkers -1  # on every machine

        with Client("tcp://SCHEDULER:8786"), parallel_config(backend="dask"):
            sweep(FireFighting, {"strategy": ["A", "B"]}, seeds=1000)

    Only the process that calls `sweep` writes files. A worker process that dies is noticed at once, since its
    connection closes; for machines that vanish set dask's ``distributed.scheduler.worker-ttl`` to 5 s.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     made = sweep("fire_fighting", {"n_robots": [2, 3]}, seeds=2, steps=5, out=home, jobs=1)
    ...     made.runs, made.failed, made.frame()["n_robots"].tolist()
    (4, 0, [2, 2, 3, 3])
    """
    workers = checked_jobs(jobs)
    model_class = find_model(model) if isinstance(model, str) else model
    experiment = checked_experiment(model_class, varied, seeds=seeds, steps=steps, settings=settings, measure=measure)
    return run_experiment(experiment, check_writable(out), workers, progress, retry_failed)


def run_experiment(
    experiment: Experiment, folder: Path, workers: int = 1, progress: bool = False, retry_failed: bool = False
) -> Sweep:
    """Do what is left of an experiment, and write its table.

    Parameters
    ----------
    experiment : Experiment
    folder : Path
        Of the ledger and the table.
    workers : int
        Processes, from `checked_jobs`.
    progress, retry_failed : bool
    """
    with Ledger(folder / LEDGER, retry_failed=retry_failed) as ledger:
        before = sum(task.key in ledger for task in experiment.tasks())
        with progress_bar(len(experiment), "runs", progress) as bar:
            bar.initial = bar.n = before
            bar.refresh()
            for task, outcome in _outcomes(experiment, ledger, workers):
                ledger.append(task.key, outcome)
                bar.update()
        path = write_table(experiment, ledger, folder / TABLE)
        failed = sum(ledger.outcome(task.key).error is not None for task in experiment.tasks())
    return Sweep(path, len(experiment), failed, before)


def _outcomes(experiment: Experiment, ledger: Ledger, workers: int) -> Iterator[tuple[Task, Outcome]]:
    """Yield the runs that are left as they are done."""
    left = (task for task in experiment.tasks() if task.key not in ledger)
    if workers == 1 and not is_remote():
        yield from (_done(experiment.model_class, task) for task in left)
        return
    yield from _survivors(experiment.model_class, left, workers)


def _survivors(model_class: type, tasks: Iterator[Task], workers: int) -> Iterator[tuple[Task, Outcome]]:
    """Yield runs as they are done, and go on when workers die."""
    deaths: Counter[str] = Counter()
    again: list[Task] = []
    while True:
        under_way: dict[str, Task] = {}
        try:
            yield from _together(model_class, _noted([*again], tasks, under_way), under_way, workers)
            return
        except WorkerDiedError:
            deaths.update(under_way.keys())  # a mapping would be taken for counts
        again = [task for key, task in under_way.items() if deaths[key] == 1]
        for task in (task for key, task in under_way.items() if deaths[key] > 1):
            yield _alone(model_class, task, deaths)


def _together(
    model_class: type, tasks: Iterator[Task], under_way: dict[str, Task], workers: int
) -> Iterator[tuple[Task, Outcome]]:
    for task, outcome in on_all(workers, _done, ((model_class, task) for task in tasks)):
        yield task, outcome
        del under_way[task.key]  # by now it is in the ledger


def _noted(again: list[Task], tasks: Iterator[Task], under_way: dict[str, Task]) -> Iterator[Task]:
    """Yield first what is tried again, then what is new, and note what is handed out."""
    for source in (again, tasks):
        for task in source:
            if task.key not in under_way:  # samples of whole numbers may have a point twice
                under_way[task.key] = task
                yield task


def _alone(model_class: type, task: Task, deaths: Counter[str]) -> tuple[Task, Outcome]:
    """Try a run with nothing beside it, so that nobody else can be to blame."""
    while deaths[task.key] < TRIES:
        try:
            (done,) = on_all(2, _done, [(model_class, task)])  # two, since one would be this very process
            return done
        except WorkerDiedError:
            deaths[task.key] += 1
    return task, Outcome(error=f"WorkerDiedError: the process died in each of {TRIES} tries")


def _done(model_class: type, task: Task) -> tuple[Task, Outcome]:
    return task, carried_out(model_class, task)
