"""Compare values of a model's parameter over paired seeds, on all cores."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from joblib import cpu_count

from mesa_swarm.errors import InvalidValueError, check_count
from mesa_swarm.experiments.experiment import Experiment, Outcome, checked_settings, source_hash
from mesa_swarm.experiments.figures import comparison_pictures, write_with_pictures
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.plan import Plan, Run, checked_plan, is_plain
from mesa_swarm.experiments.pool import results_of
from mesa_swarm.experiments.tables import finding, runs_csv, summary_csv, summary_rows, text_table
from mesa_swarm.files import check_writable
from mesa_swarm.progress import progress_bar
from mesa_swarm.viewing.final_state import FinalState

MOST_JOBS = 1024
# A comparison stores its runs here, in the folder of its tables.
LEDGER = "runs.jsonl"


@dataclass(frozen=True, slots=True, repr=False)
class Comparison:
    """What came of a comparison.

    Parameters
    ----------
    plan : Plan
        What was compared.
    runs : tuple of Run
        By seed, then by value, whatever the order in which they were done.
    done_before : int
        How many of them an earlier call had done.

    Examples
    --------
    >>> comparison = compare("fire_fighting", seeds=2, steps=5, jobs=1)
    >>> comparison.column("A", "fires out")
    [0, 0]
    """

    plan: Plan
    runs: tuple[Run, ...]
    done_before: int = field(default=0, compare=False)

    def __repr__(self) -> str:
        return f"{self.table()}\n\n{self.finding()}"

    def column(self, value: Any, measure: str) -> list[float | None]:
        """Return a measure in all runs with one value, by seed."""
        return [run.results[measure] for run in self.runs if run.value == value]

    @property
    def measures(self) -> list[str]:
        """The names of what was measured."""
        return list(self.runs[0].results)

    @property
    def portraits(self) -> dict[Any, FinalState]:
        """The final state under each value, with the first seed."""
        return {run.value: run.portrait for run in self.runs if run.portrait is not None}

    def table(self) -> str:
        """Return the summary as text, at most 100 columns wide."""
        return text_table(self)

    def finding(self) -> str:
        """Return in one sentence what was found."""
        return finding(self)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the tables and pictures, all of them or none, and return their paths.

        If a picture cannot be drawn, the tables are written without any, before that error is raised.

        Raises
        ------
        InvalidValueError
            If the folder cannot be written to.
        """
        tables = {
            "runs.csv": runs_csv(self),
            "summary.csv": summary_csv(summary_rows(self)),
            "finding.txt": f"{self.finding()}\n",
        }
        return write_with_pictures(check_writable(folder), tables, partial(comparison_pictures, self))


def compare(
    model: type | str,
    parameter: str | None = None,
    values: Iterable | None = None,
    seeds: int | Sequence[int] = 30,
    *,
    steps: int | None = None,
    settings: Mapping[str, Any] | None = None,
    measures: Sequence[str] = (),
    jobs: int = -1,
    progress: bool = False,
    out: str | os.PathLike[str] | None = None,
) -> Comparison:
    """Run a model with several values of one parameter over the same seeds, and compare what comes of it.

    Runs with the same seed share their random numbers (common random numbers, [1]_): robots start at the same
    places, and sensors and wheels err alike, so that differences within a seed show the parameter and not luck.
    Every value is compared with the first. The outcome does not depend on the number of jobs.

    ==================  ================================================================================
    what                how it is estimated, with its 95 % interval
    ==================  ================================================================================
    in runs             share of runs in which it happened: the result was not None; Wilson
    mean                over those runs; bootstrap over seeds (`statistics.bootstrap_mean`)
    minus the first     mean of the differences on the same seed, over seeds on which it happened under
                        both; bootstrap over these pairs
    larger on           effect size: the share of seeds on which it was larger than under the first value,
                        ties half (`statistics.superiority`); Wilson. A result whose name ends in "at" is
                        a time: where it did not happen it counts as later than any.
    ==================  ================================================================================

    Parameters
    ----------
    model, parameter, values, seeds, steps, settings, measures
        See `checked_plan`.
    jobs : int
        Processes that work at the same time; -1 for one on each core.
    progress : bool
        Whether to show a bar with the time left and the time of day at which it is done.
    out : path, optional
        Folder in which each run is stored as soon as it is done. A comparison that was interrupted, or whose process
        was killed, goes on from there when it is called again with the same folder. Runs of code that was changed
        since are other runs (`source_hash`).

    Raises
    ------
    SwarmError
        Before anything is run, if anything about it is wrong.

    References
    ----------
    .. [1] Law, Simulation Modeling and Analysis, 5th edition (2015), section 11.2.

    Examples
    --------
    >>> found = compare("fire_fighting", "strategy", ["A", "B"], 2, steps=5, jobs=1)
    >>> found.column("B", "fires out"), found.plan.steps
    ([0, 0], 5)
    >>> compare("agglomeration", "n_robots", [4, 6], seeds=[7], steps=5, jobs=1).runs[0].rng
    7
    """
    workers = checked_jobs(jobs)
    plan = checked_plan(model, parameter, values, seeds, steps=steps, settings=settings, measures=measures)
    return run_plan(plan, workers, progress, folder=None if out is None else check_writable(out))


def checked_jobs(jobs: int) -> int:
    """Return how many processes will work: as many as there are cores for -1.

    Examples
    --------
    >>> checked_jobs(2)
    2
    """
    if jobs == -1:
        return cpu_count()
    try:
        return check_count("jobs", jobs, minimum=1, maximum=MOST_JOBS)
    except InvalidValueError as error:
        raise InvalidValueError(f"{error}, or -1 for one on each core") from None


def run_plan(
    plan: Plan,
    workers: int = 1,
    progress: bool = False,
    heard: Callable[[Run], object] | None = None,
    folder: Path | None = None,
) -> Comparison:
    """Do all runs of a plan, but for those that a folder has, and return what they gave.

    Parameters
    ----------
    plan : Plan
    workers : int
        Processes, from `checked_jobs`.
    progress : bool
    heard : callable, optional
        Called with each run as it is done.
    folder : Path, optional
        Where each run is stored as soon as it is done.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> len(run_plan(checked_plan(find_model("fire_fighting"), seeds=1, steps=2)).runs)
    2
    """
    if folder is None:
        return _compared(plan, workers, progress, heard, None)
    with Ledger(folder / LEDGER, fits=has_numbers) as ledger:
        return _compared(plan, workers, progress, heard, ledger)


def has_numbers(outcome: Outcome) -> bool:
    """Return whether an outcome is one of a run that was compared: results, each of which is a number or None.

    Examples
    --------
    >>> has_numbers(Outcome(results={"groups": 2.0})), has_numbers(Outcome(error="it broke"))
    (True, False)
    """
    return bool(outcome.results) and all(map(is_plain, (outcome.results or {}).values()))


def _compared(
    plan: Plan, workers: int, progress: bool, heard: Callable[[Run], object] | None, ledger: Ledger | None
) -> Comparison:
    keys = [] if ledger is None else _keys(plan)
    stored = {} if ledger is None else _stored(plan, keys, ledger)
    # Portraits are not stored: for the pictures the runs with the first seed are done again.
    runs = {index: run for index, run in stored.items() if run.rng != plan.seeds[0]}
    with progress_bar(len(plan.tasks), "runs", progress) as bar:
        bar.initial = bar.n = len(runs)
        bar.refresh()
        for index, run in _done(plan, workers, dict(runs)):
            bar.update(index not in runs)
            runs[index] = run
            if ledger is not None and not (index in stored and _is_alike(stored[index], run)):
                stored.pop(index, None)
                ledger.append(keys[index], Outcome(run.steps, run.state_hash, run.results))
            if heard is not None:
                heard(run)
    return Comparison(plan, tuple(runs[index] for index in range(len(runs))), len(stored))


def _done(plan: Plan, workers: int, stored: Mapping[int, Run]) -> Iterator[tuple[int, Run]]:
    """Yield as they are done the runs that are not stored, then those stored with other results than the first has."""
    first = None
    for index, run in _made(plan, workers, [index for index in range(len(plan.tasks)) if index not in stored]):
        first = run if index == 0 else first
        yield index, run
    yield from _made(plan, workers, [index for index, run in stored.items() if first and not _is_alike(first, run)])


def _made(plan: Plan, workers: int, indices: Sequence[int]) -> Iterator[tuple[int, Run]]:
    """Do these runs, and yield them as they are done."""
    tasks = plan.tasks
    left = [(plan, index, tasks[index]) for index in indices]
    yield from results_of(min(workers, max(len(left), 1)), _numbered_run, left)


def _is_alike(one: Run, another: Run) -> bool:
    """Return whether two runs have the same results in the same order, whatever their numbers."""
    return list(one.results) == list(another.results)


def _numbered_run(plan: Plan, index: int, task: tuple[int, Any]) -> tuple[int, Run]:
    return index, plan.run(*task)


def _keys(plan: Plan) -> list[str]:
    """Return the fingerprint of each run of a plan: those of a sweep, so that runs of changed code are other runs."""
    points = [checked_settings(plan.model_class, {**plan.settings, plan.parameter: value}) for value in plan.values]
    source = source_hash(plan.model_class)
    experiment = Experiment(plan.model_class, {}, points, plan.seeds, plan.steps, source=source)
    measures = {"measures of a comparison": list(plan.measures)}
    return [experiment.key({**point, **measures}, rng) for rng in plan.seeds for point in points]


def _stored(plan: Plan, keys: list[str], ledger: Ledger) -> dict[int, Run]:
    """Return the runs of a plan that a ledger has, without portraits."""
    found = {}
    for index, ((rng, value), key) in enumerate(zip(plan.tasks, keys, strict=True)):
        outcome = ledger.outcome(key)
        if outcome is not None:
            found[index] = Run(value, rng, outcome.steps, outcome.state_hash or "", outcome.results or {})
    return found
